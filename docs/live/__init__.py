"""A live chain of prisms in one page: the project's own C, compiled to WebAssembly."""
