"""Pages in which results move: one file of HTML with its programs and data, which reaches nothing
outside of it.  `page` makes it; `viewer.js` draws, for the live page as well, `player.js` plays."""
