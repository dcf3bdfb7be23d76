"""Faults that must not survive: slips of one line, and for each the test that notices it.

`python -m tests.faults [WORD ...]` breaks a copy of the tree, one line at a time, and runs that
test alone, which has to pass before and fail then, or not to end in a time far above the one
that it took; a word picks the faults in whose file or test it occurs.  What a slip is: a sign, an
index, a factor, a guard that was dropped.
"""

from __future__ import annotations

import argparse
import contextlib
import ctypes
import os
import shutil
import signal
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

ROOT = Path(__file__).parent.parent
OUTSIDE = shutil.ignore_patterns(".*", "*.egg-info", "build", "_build", "output", "__pycache__")
PATIENCE = 60.0  # seconds for a test, to which
SLOWER = 20  # times what it takes unbroken are added
FAILED = 1  # what pytest returns where tests ran and some failed
ENDLESS = -1  # what stands for it where it did not end in time
PDEATHSIG = 1  # of Linux' prctl: the signal that a process gets when its parent ends


@dataclass(frozen=True)
class Fault:
    """One slip.

    Attributes
    ----------
    file : str
        Path from the root.
    text : str
        What stands there, once in the file.
    fault : str
        What a slip would make of it.
    test : str
        Node of the test that must fail then.
    """

    file: str
    text: str
    fault: str
    test: str

    def broken(self, source: str) -> str:
        """The file's text with the slip; ValueError unless `text` stands there exactly once."""
        if (found := source.count(self.text)) != 1:
            raise ValueError(f"{self.text!r} stands {found} times in {self.file}, must be once")
        return source.replace(self.text, self.fault)


FAULTS = (
    # bounds of what is given
    Fault(
        "tensegrity/check.py",
        "if below is not None and not value < below:",
        "if below is not None and not value <= below:",
        "tests/test_check.py::test_an_upper_bound_is_no_value_itself",
    ),
    Fault(
        "tensegrity/check.py",
        "if below is not None and value >= below:",
        "if below is not None and value > below:",
        "tests/test_check.py::test_an_upper_bound_is_no_value_itself",
    ),
    # what notebooks show
    Fault(
        "tensegrity/notebook.py",
        "{html.escape(str(value))}</td></tr>",
        "{value}</td></tr>",
        "tests/test_notebook.py::test_text_is_escaped_and_a_run_without_all_sites_has_no_picture",
    ),
    # the self-test
    Fault(
        "tensegrity/__main__.py",
        "right = error <= bound  #",
        "right = not error > bound  #",
        "tests/test_self_test.py::test_a_number_that_is_wrong_or_none_fails_it",
    ),
    # springs for other programs
    Fault(
        "tensegrity/export.py",
        "law, (low, high) = potential.law, potential.reach",
        "law, (low, high) = potential.law, (-math.inf, math.inf)",
        "tests/test_export.py::test_driver_refuses_what_is_outside_of_the_domain",
    ),
    Fault(
        "tensegrity/export.py",
        '.replace("*/", "* /")',
        "",
        "tests/test_export.py::test_names_and_comments_hold_only_what_c_takes",
    ),
    # design of protectors
    Fault(
        "granular/design/objective.py",
        "return share, start + share * (rise + share * (bend + share * twist))",
        "return share, start",
        "tests/test_design_objective.py::test_maxima_between_the_steps_count",
    ),
    Fault(
        "granular/design/finalists.py",
        "worth = np.where(holds, finer[-1], np.inf) if holds.any() else finer.max(axis=0)",
        "worth = forces[first : first + FINALISTS]",
        "tests/test_design_search.py::test_a_design_that_moves_with_the_step_is_not_taken",
    ),
    Fault(
        "granular/design/searching.py",
        "rows[len(forces) :]",
        "rows",
        "tests/test_design_search.py::"
        "test_a_search_goes_on_from_its_checkpoint_and_computes_nothing_twice",
    ),
    Fault(
        "tensegrity/runs/rows.py",
        "fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)",
        "pass",
        "tests/test_resume.py::test_a_second_run_of_a_path_is_refused_before_it_writes",
    ),
    Fault(
        "tensegrity/gradients/chained.py",
        "for any_sides, law in enumerate(_rigid()):",
        "for any_sides, law in enumerate(_rigid()[:1]):",
        "tests/test_gradients.py::test_prisms_of_any_sides_are_differentiated_by_their_arguments",
    ),
    Fault(
        "tensegrity/runs/sweep.py",
        "left = [k for k in range(len(cases)) if k not in ledger.results]",
        "left = list(range(len(cases)))",
        "tests/test_sweep.py::test_a_sweep_goes_on_from_its_checkpoint",
    ),
    # structures
    Fault(
        "tensegrity/structures/members.py",
        "return ~self.pulls_only | (lengths",
        "return self.pulls_only | (lengths",
        "tests/test_structure.py::test_tangent_of_icosahedron_has_the_reference_eigenvalues",
    ),
    Fault(
        "tensegrity/structures/members.py",
        "(1 - within) * self.natural",
        "self.natural",
        "tests/test_structure_frames.py::"
        "test_stiffness_modes_and_stability_are_the_same_in_any_frame",
    ),
    Fault(
        "tensegrity/structures/dynamics.py",
        "sp.Heaviside(r + margin)",
        "sp.Heaviside(r - SMALLEST)",
        "tests/test_structure_frames.py::test_modes_of_a_structure_are_those_of_its_network",
    ),
    Fault(
        "tensegrity/structures/solve.py",
        "within = TAUT if x is positions else 0.0",
        "within = TAUT",
        "tests/test_structure_frames.py::"
        "test_equilibria_with_a_string_hardly_slack_are_right_to_round_off",
    ),
    Fault(
        "tensegrity/structures/supports.py",
        "share = normal / np.sqrt(len(group))",
        "share = normal",
        "tests/test_structure.py::test_motions_that_supports_and_platforms_leave_are_orthonormal",
    ),
    Fault(
        "tensegrity/structures/corner.py",
        "least = min(r.slope for r in lowest)",
        "least = max(r.slope for r in lowest)",
        "tests/test_structure_path.py::test_of_several_stable_rays_the_lowest_is_followed",
    ),
    Fault(
        "tensegrity/structures/corner.py",
        "if sense == -arrived and (choice == taut).all():",
        "if False:",
        "tests/test_structure_control.py::"
        "test_growing_bars_bow_then_snap_at_a_slack_corner_of_their_closed_form",
    ),
    Fault(
        "tensegrity/structures/corner.py",
        "return x if close < SHRUNK * far or far <= NEAR * of.span else None",
        "return x",
        "tests/test_structure_snap.py::"
        "test_a_structure_snaps_only_where_no_minimum_beyond_comes_near",
    ),
    Fault(
        "tensegrity/structures/walk.py",
        "if not back.any() or first < SETTINGS.smallest:",
        "if True:",
        "tests/test_structure_snap.py::"
        "test_a_string_is_taut_again_however_soon_after_it_went_slack",
    ),
    Fault(
        "tensegrity/structures/equations.py",
        "(density[:, None] * d).ravel() - of.weight",
        "(density[:, None] * d).ravel() + of.weight",
        "tests/test_structure_control.py::"
        "test_weight_on_an_arch_of_shrinking_bars_snaps_at_the_fold_of_its_closed_form",
    ),
    Fault(
        "tensegrity/structures/equations.py",
        "g = left - u[-2] * along",
        "g = left + u[-2] * along",
        "tests/test_structure_path.py::test_icosahedron_between_plates_carries_the_reference_loads",
    ),
    Fault(
        "tensegrity/prisms/members.py",
        "density / (stiffness[0] - density)",
        "density / stiffness[0]",
        "tests/test_ngon.py::test_laboratory_prism_comes_from_its_members",
    ),
    Fault(
        "granular/design/downhill.py",
        "by_constant[:, -1] += by_force @ force / self._table[-1, 0]",
        "pass",
        "tests/test_downhill.py::test_forces_and_slopes_are_those_of_the_gradient_of_a_run",
    ),
    Fault(
        "tensegrity/engine/reverse.py",
        "for array in (self.ub, self.vb, totals.w, totals.p, totals.g):",
        "for array in (self.ub, self.vb, totals.w, totals.g):",
        "tests/test_downhill.py::test_what_a_pass_computes_does_not_depend_on_those_before_it",
    ),
    Fault(
        "granular/design/searching.py",
        "self._fresh(rows[len(known) :], begun + len(known))",
        "self._fresh(rows, begun)",
        "tests/test_downhill.py::test_a_search_goes_on_from_its_checkpoint",
    ),
    # waves at walls and beyond corners
    Fault(
        "tensegrity/waves/pieces.py",
        "return self.twice(x + 1) - 2 * self.twice(x) + self.twice(x - 1)",
        "return self.twice(x + 1) - 2 * self.twice(x) + 1.000001 * self.twice(x - 1)",
        "tests/test_open_waves.py::test_a_wave_whose_contacts_open_obeys_its_equation",
    ),
    Fault(
        "tensegrity/waves/pieces.py",
        "matrix[n, :n] = -mesh.at_kink * slope",
        "matrix[n, :n] = mesh.at_kink * slope",
        "tests/test_open_waves.py::test_waves_whose_contacts_open_are_found_up_to_the_predicted_crest",
    ),
    Fault(
        "tensegrity/waves/family.py",
        "lag = y * (1 / np.sqrt(1 - self.stored(crest - y) / stored) - 1)",
        "lag = 0 * y",
        "tests/test_prediction.py::"
        "test_a_domain_that_ends_next_to_a_wall_has_the_speed_of_masses_that_collide",
    ),
    Fault(
        "tensegrity/waves/prediction.py",
        "if near > 1 - STEADY and not side.finite_at_end:",
        "if near > 1 - STEADY:",
        "tests/test_prediction.py::"
        "test_a_domain_that_ends_next_to_a_wall_has_the_speed_of_masses_that_collide",
    ),
    Fault(
        "tensegrity/waves/prediction.py",
        "if side.top_stiffness < 0:",
        "if side.top_stiffness <= 0:",
        "tests/test_prediction.py::test_a_front_at_a_constant_force_is_not_told_to_give_way",
    ),
    # the lens
    Fault(
        "tensegrity/lens/lens.py",
        "chosen = np.clip(first * np.exp(-found.slope(leave) * missed), low, high)",
        "chosen = first",
        "tests/test_lens.py::test_pulses_meet_at_the_focus_within_a_thousandth_of_the_pulse",
    ),
    Fault(
        "tensegrity/lens/lens.py",
        "rays = reached.t + self.distances / self.host_speed",
        "return reached.t + self.distances / self.host_speed",
        "tests/test_lens.py::test_pulses_meet_at_the_focus_within_a_thousandth_of_the_pulse",
    ),
    Fault(
        "tensegrity/lens/radiation.py",
        "np.where(inside, at(y) - taken, 0.0)",
        "np.where(inside, at(y), 0.0)",
        "tests/test_lens.py::test_pistons_agree_with_quadrature_over_their_face",
    ),
    Fault(
        "tensegrity/lens/radiation.py",
        "k = k[(left > least[k]) | (nodes < fewest[k])]",
        "k = k[:0]",
        "tests/test_lens.py::test_a_mean_over_an_angle_is_as_good_as_asked",
    ),
    Fault(
        "tensegrity/lens/radiation.py",
        "min(peak / float(each.sum()), 1.0)",
        "peak / peak",
        "tests/test_lens.py::test_alignment_says_that_the_peak_is_the_sum_of_single_peaks",
    ),
    Fault(
        "tensegrity/lens/radiation.py",
        "_face(self.radius, abs(end - place))",
        "_face(self.radius, 0.0)",
        "tests/test_lens.py::test_energy_that_ends_radiate_together_comes_to_the_far_field",
    ),
    Fault(
        "tensegrity/lens/struck.py",
        "later = np.flatnonzero(np.diff(t) >= 0)",
        "later = np.flatnonzero(np.diff(t) > 99)",
        "tests/test_lens.py::test_arrival_that_is_not_monotone_is_refused",
    ),
    # gradients
    Fault(
        "tensegrity/engine/reverse_steps.c",
        "for (integer i = c->stages - 1; i >= 0; i--)",
        "for (integer i = 0; i < c->stages; i++)",
        "tests/test_gradients.py::test_gradients_are_the_references_of_ninety_digits",
    ),
    Fault(
        "tensegrity/engine/reverse.h",
        "c->f[1 + i] = c->k[i] = 0;",
        "c->f[1 + i] = 0;",
        "tests/test_gradients.py::test_a_chain_turned_end_for_end_has_its_gradients_turned[rkn6]",
    ),
    Fault(
        "granular/design/finalists.py",
        "max(float(worth[k]), longer)",
        "float(worth[k])",
        "tests/test_design_search.py::test_a_design_whose_force_grows_after_the_window_is_passed_over",
    ),
    Fault(
        "tensegrity/gradients/compute.py",
        "rows[inside] = part.rows",
        "rows[inside] += 2 * part.rows",
        "tests/test_gradients.py::test_gradients_are_the_references_of_ninety_digits",
    ),
    Fault(
        "tensegrity/engine/reverse_net.c",
        "across * (y[q] - t * along[q * n + i])",
        "across * y[q]",
        "tests/test_gradient_networks.py::test_gradients_of_networks_are_those_of_complex_steps",
    ),
    Fault(
        "tensegrity/gradients/backward.py",
        "opened=k - many > 0",
        "opened=True",
        "tests/test_gradients.py::test_gradients_are_the_references_of_ninety_digits",
    ),
    Fault(
        "tensegrity/gradients/chained.py",
        "moved = np.where(carrying[mine], -load[0] / load[1], moved)",
        "moved = np.where(carrying[mine], 0.0, moved)",
        "tests/test_gradients.py::test_traces_and_numbers_of_them_are_differentiated_as_finite_differences_say",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "at.curvature * sums[1] / 2 + at.pull * sums[2]",
        "at.curvature * sums[1] / 2",
        "tests/test_openings.py::test_order_is_the_exponent_and_three_not_and_one[chain-1.5]",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "curvature, curvature - swing(c, o, b, x)}",
        "curvature, curvature}",
        "tests/test_openings.py::test_order_is_the_exponent_and_three_not_and_one[space-2.0]",
    ),
    Fault(
        "tensegrity/engine/steps.c",
        "integer advance(const scene *c, const void *none, integer steps, integer opened)\n"
        "{\n    FLUSH\n",
        "integer advance(const scene *c, const void *none, integer steps, integer opened)\n{\n",
        "tests/test_kernel.py::test_numbers_below_the_smallest_normal_one_are_none_in_a_loop_and_some"
        "_outside",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "o->begins = !opened;",
        "o->begins = 0;",
        "tests/test_openings.py::test_a_run_that_begins_just_beside_an_event_has_the_order"
        "[before an opening-1-0.05]",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "total += between(o, b, at, x, opens, -1, &before);",
        "",
        "tests/test_openings.py::test_a_run_that_begins_just_beside_an_event_has_the_order"
        "[after closings-1-0.05]",
    ),
    Fault(
        "tensegrity/engine/compiled.py",
        "springs = np.repeat(springs[:, None], self.lanes, axis=1)",
        "pass",
        "tests/test_ensemble.py::test_lanes_move_as_chains_alone[unequal-rkn6]",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "all + between(o, b, at, x, opens, opens, &moment);",
        "all;",
        "tests/test_openings.py::test_every_row_has_the_order_not_only_those_far_from_events[chain]",
    ),
    Fault(
        "tensegrity/engine/line_openings.c",
        "c->u[b + LANES] -= right * shift;",
        "c->u[b + LANES] += right * shift;",
        "tests/test_openings.py::test_two_bodies_keep_their_momentum_to_the_last_bit",
    ),
    Fault(
        "tensegrity/engine/net_openings.c",
        "add(c->v + from + k, c->w[from + k] * impulse[k]);",
        "add(c->v + from + k, impulse[k]);",
        "tests/test_openings.py::test_momentum_and_angular_momentum_of_a_network_are_kept",
    ),
    Fault(
        "tensegrity/engine/openings.c",
        "first += power * y / (alpha + 2);",
        "first += power * y / (alpha + 1);",
        "tests/test_openings.py::test_what_kicks_of_one_step_make_too_much_is_the_derived_one",
    ),
    # derivations
    Fault(
        "tensegrity/branches/table.py",
        "replace(e, row=kept[e.row])",
        "replace(e)",
        "tests/test_continuation.py::test_events_of_a_slice_count_its_own_rows",
    ),
    Fault(
        "derivations/rigid_response.py",
        "max(exponent + 1, sp.Integer(0))",
        "max(exponent + 2, sp.Integer(0))",
        "tests/test_derivations_numeric.py::test_force_and_energy_grow_towards_locking_with_the_stated_powers",
    ),
    Fault(
        "tensegrity/branches/follow.c",
        "distance(curve, low) <= reach && distance(curve, high) <= reach",
        "reach >= 0",
        "tests/test_continuation.py::test_events_lie_between_the_rows_that_they_are_told_to",
    ),
    Fault(
        "tensegrity/branches/arclength.py",
        "        moved <= step / 2,\n",
        "",
        "tests/test_continuation.py::test_loose_tolerance_does_not_step_across_a_bend",
    ),
    Fault(
        "tensegrity/scenes/clearance.py",
        "self._list(u)\n            moved = 0.0",
        "moved = 0.0",
        "tests/test_following.py::test_a_gas_meets_the_pairs_that_a_list_of_all_meets",
    ),
    Fault(
        "derivations/prism.py",
        "self.count(of) / 2 * self.stiffness",
        "self.count(of) * self.stiffness",
        "tests/test_derivations_prism.py::test_energy_is_that_of_3_cross_strings_6_base_strings_and_3_bars",
    ),
    Fault(
        "derivations/prism.py",
        'CROSS = Member("cross", k_cross, natural_cross, -1, True)',
        'CROSS = Member("cross", k_cross, natural_cross, 1, True)',
        "tests/test_derivations_prism.py::test_axial_stiffness_is_the_condensed_hessian",
    ),
    Fault(
        "derivations/waves.py",
        "symbol = stiffness * (shift - 2 + 1 / shift) / mass",
        "symbol = stiffness * (shift - 1 + 1 / shift) / mass",
        "tests/test_derivations_waves.py::test_dispersion_is_that_of_a_ring_of_masses",
    ),
    Fault(
        "derivations/contact.py",
        "curvature = 1 / radius_1 + 1 / radius_2",
        "curvature = 1 / radius_1 - 1 / radius_2",
        "tests/test_derivations_waves.py::test_hertz_constant_of_two_materials",
    ),
    Fault(
        "derivations/rigid_response.py",
        "pull / (2 * length) * kappa",
        "pull / length * kappa",
        "tests/test_derivations_prism.py::test_force_near_locking_and_energy_there",
    ),
    # engine
    Fault(
        "tensegrity/engine/structs.py",
        "values.keys() ^ self._kinds.keys()",
        "values.keys() - self._kinds.keys()",
        "tests/test_structs.py::test_every_field_is_given_by_its_name_and_no_other",
    ),
    Fault(
        "tensegrity/engine/steps.c",
        "kick(c, i, k > 0 || opened)",
        "kick(c, i, k > 0)",
        "tests/test_pieces.py::test_pieces_equal_the_whole_bit_for_bit",
    ),
    Fault(
        "tensegrity/engine/net_law.c",
        "sum[k] -= forces[k];",
        "sum[k] += forces[k];",
        "tests/test_network.py::test_free_patch_keeps_energy_momentum_and_angular_momentum",
    ),
    Fault(
        "tensegrity/engine/net_law.c",
        "if (at + g == c->begin[z]) AXES",
        "AXES",
        "tests/test_lanes.py::test_listed_contacts_that_do_not_touch_change_no_bit",
    ),
    Fault(
        "tensegrity/engine/slices.py",
        "if crowding is not None:",
        "if False:",
        "tests/test_lanes.py::test_listed_contacts_that_do_not_touch_change_no_bit",
    ),
    Fault(
        "tensegrity/engine/slices.py",
        "if other is None:",
        "if True:",
        "tests/test_lanes.py::test_listed_contacts_that_do_not_touch_change_no_bit",
    ),
    Fault(
        "tensegrity/engine/net.c",
        "for (; q < count; q++)",
        "for (; q < 0; q++)",
        "tests/test_network.py::test_orders_on_a_smooth_patch",
    ),
    Fault(
        "tensegrity/engine/net.c",
        "AXES(k) sum[k] += c->press",
        "AXES(k) sum[k] = c->press",
        "tests/test_lanes.py::test_forces_are_the_sums_over_all_contacts",
    ),
    Fault(
        "tensegrity/engine/lanes.py",
        "a, b = self._negated[b], a",
        "b = self._negated[b]",
        "tests/test_lanes.py::test_every_operation_does_what_casadi_does",
    ),
    Fault(
        "tensegrity/engine/slices.py",
        '"needed": np.minimum.accumulate(lowest[::-1])[::-1]',
        '"needed": lowest',
        "tests/test_lanes.py::test_threads_give_the_bits_of_one",
    ),
    Fault(
        "tensegrity/engine/lanes.c",
        "q + (x - y * q) * z2",
        "q",
        "tests/test_lanes.py::test_roots_and_quotients_are_exact_to_a_unit_or_two",
    ),
    Fault(
        "tensegrity/engine/lanes.c",
        "ESTIMATE(x + wide(0))",
        "ESTIMATE(x)",
        "tests/test_lanes.py::test_the_root_of_nothing_is_nothing_and_below_there_is_none",
    ),
    Fault(
        "tensegrity/engine/line_law.c",
        "(all < BLOCK ? all : BLOCK)",
        "(all < BLOCK ? all : 1)",
        "tests/test_one_engine.py::test_ranges_of_many_equal_bonds_are_those_of_all",
    ),
    Fault(
        "tensegrity/engine/line_law.c",
        "for (integer i = n; i % WIDE; i++) r[i] = r[n - 1];",
        "for (integer i = n - 1; i % WIDE; i++) r[i] = r[0];",
        "tests/test_one_engine.py::test_bonds_with_parameters_of_their_own_pull_as_each_alone"
        "[graded]",
    ),
    Fault(
        "tensegrity/engine/steps.c",
        "EACH(n) place[i] = u[i] + node * v[i];",
        "EACH(n) place[i] = u[i];",
        "tests/test_methods.py::test_the_nystrom_form_does_the_steps_of_the_tableau",
    ),
    Fault(
        "tensegrity/engine/bonds.py",
        "joins = varied.copy()",
        "joins = np.zeros_like(varied)",
        "tests/test_one_engine.py::test_lanes_of_one_spring_each_have_their_own",
    ),
    Fault(
        "tensegrity/engine/line_law.c",
        "low[PLACE(q)] = r[i] < low[PLACE(q)] ? r[i] : low[PLACE(q)];",
        "low[PLACE(q)] = r[i];",
        "tests/test_one_engine.py::test_bonds_with_parameters_of_their_own_pull_as_each_alone",
    ),
    Fault(
        "tensegrity/engine/forces.py",
        "parts += [(first, first, block, pair), (second, first, -block, pair)]",
        "parts += [(first, first, block, pair), (second, first, block, pair)]",
        "tests/test_one_engine.py::"
        "test_forces_are_the_slope_of_the_energy_and_stiffness_that_of_the_forces",
    ),
    Fault(
        "tensegrity/springs/collection.py",
        "r[np.minimum(first, len(r) - 1), every], before)",
        "r[np.maximum(first - 1, 0), every], before)",
        "tests/test_search.py::test_the_same_values_give_the_same_bits",
    ),
    Fault(
        "tensegrity/engine/search.c",
        "double inside = before, outside = 0;",
        "double inside = 0, outside = 0;",
        "tests/test_search.py::test_a_linear_spring_reaches_the_root_of_twice_the_energy[Springs]",
    ),
    Fault(
        "tensegrity/engine/search.c",
        "if (is_out) outside = r[j];",
        "if (is_out) outside = inside;",
        "tests/test_search.py::test_a_linear_spring_reaches_the_root_of_twice_the_energy",
    ),
    Fault(
        "tensegrity/engine/search.c",
        "if (begun && !known) return last;",
        "",
        "tests/test_search.py::test_the_same_values_give_the_same_bits",
    ),
    Fault(
        "tensegrity/engine/search.c",
        "held && !found",
        "held && found",
        "tests/test_search.py::test_the_end_of_a_domain_is_reached_with_the_energy_there",
    ),
    Fault(
        "tensegrity/engine/search.c",
        "if (!(end > domain[0] && end < domain[1])) return 0;",
        "",
        "tests/test_search.py::test_ranges_outside_of_the_domain_are_refused",
    ),
    Fault(
        "tensegrity/engine/pieces.py",
        "return start if down else start + odd",
        "return start + odd",
        "tests/test_pieces.py::test_blocks_begin_where_the_loop_begins_them",
    ),
    Fault(
        "tensegrity/engine/implicit.c",
        "c->v[i] += dt * m->slope[i]",
        "c->v[i] += m->slope[i]",
        "tests/test_midpoint.py::test_steps_solve_the_equations_of_the_rule",
    ),
    Fault(
        "tensegrity/engine/schemes.py",
        "1 - 2 * sum(half) if odd",
        "1 - sum(half) if odd",
        "tests/test_methods.py::test_rows_are_consistent_palindromes",
    ),
    # springs
    Fault(
        "tensegrity/springs/potential.py",
        "derived.exponent: n,",
        "derived.exponent: n + 1,",
        "tests/test_prism.py::test_power_law_pushes_only",
    ),
    Fault(
        "tensegrity/springs/potential.py",
        "energy = closed * stored(pressed) - stored(overlap) + preload * r",
        "energy = closed * stored(pressed) + preload * r",
        "tests/test_prism.py::test_power_law_pushes_only",
    ),
    Fault(
        "tensegrity/springs/polynomial.py",
        "(q[k] + (k + 1) * t_at_rest * s[-1])",
        "(q[k] + k * t_at_rest * s[-1])",
        "tests/test_polynomial.py::test_energy_is_the_exact_antiderivative",
    ),
    Fault(
        "tensegrity/springs/polynomial.py",
        "np.sin(_angles(DENSE * NODES) / 2)",
        "np.sin(_angles(NODES) / 2)",
        "tests/test_polynomial.py::test_an_error_that_no_node_sees_is_estimated",
    ),
    Fault(
        "tensegrity/springs/polynomial.py",
        "gap = float(np.abs(self.tension(between) - exact).max()) / peak",
        "gap = float(np.abs(self.tension(between) - exact).max())",
        "tests/test_polynomial.py::test_error_estimate_is_right_within_a_hundredth",
    ),
    # what is kept
    Fault(
        "tensegrity/engine/kept.py",
        "if digest == hashlib.sha256(content).hexdigest().encode():",
        "if digest:",
        "tests/test_fresh.py::test_a_value_is_made_once_and_again_after_damage",
    ),
    Fault(
        "tensegrity/engine/kept.py",
        'if found["of"] == key:',
        "if found:",
        "tests/test_fresh.py::test_a_value_is_made_once_and_again_after_damage",
    ),
    # branches
    Fault(
        "tensegrity/branches/arclength.py",
        "* (1 + (1 - cosine) / 12)",
        "* (1 + (1 - cosine) / 6)",
        "tests/test_continuation.py::test_arc_length_is_that_of_the_curve_to_fourth_order",
    ),
    Fault(
        "tensegrity/branches/arclength.py",
        "(tangent + t * (curve + bend))",
        "(tangent + t * curve)",
        "tests/test_continuation.py::test_rows_grow_like_the_fourth_root_of_the_tolerance",
    ),
    Fault(
        "tensegrity/branches/table.py",
        "if len(self) - 1 not in kept:",
        "if len(self) - 1 in kept:",
        "tests/test_continuation.py::test_a_part_of_a_branch_says_whether_its_end_was_cut_off",
    ),
    Fault(
        "tensegrity/branches/arclength.py",
        "        turned <= turn,\n",
        "",
        "tests/test_continuation.py::test_tangents_of_neighbouring_rows_turn_no_more_than_asked",
    ),
    Fault(
        "tensegrity/branches/follow.c",
        "memcpy(made, curve, M * sizeof(double));",
        "memcpy(made, low, M * sizeof(double));",
        "tests/test_continuation.py::test_user_events_are_roots_to_round_off_and_come_in_order",
    ),
    Fault(
        "tensegrity/branches/continuation.py",
        "tangent if lead * direction > 0",
        "tangent if lead * direction < 0",
        "tests/test_continuation.py::test_both_directions_meet_the_mirror_image",
    ),
    Fault(
        "tensegrity/branches/arclength.py",
        "self.residual] = z, self.values(z, p)",
        "self.residual] = low, self.values(z, p)",
        "tests/test_no_compiler.py::test_branches_without_a_compiler_have_the_same_events",
    ),
    Fault(
        "tensegrity/branches/arclength.py",
        "if cosine < ALIGNED:",
        "if cosine < -ALIGNED:",
        "tests/test_structure_path.py::test_path_ends_on_its_own_branch_where_others_are_near",
    ),
    # prisms
    Fault(
        "tensegrity/prisms/closed.py",
        "float(unloaded.tension(r)) + preload",
        "float(unloaded.tension(r)) - preload",
        "tests/test_prism.py::test_preload_shifts_to_the_loaded_equilibrium",
    ),
    Fault(
        "derivations/mixed.py",
        "return -slopes[2]",
        "return -slopes[2] / 3",
        "tests/test_response.py::test_beyond_slack_the_prism_without_base_strings_is_in_equilibrium",
    ),
    Fault(
        "tensegrity/prisms/rigid_path.py",
        '"twist": prism.reference_twist + 2 * np',
        '"twist": prism.reference_twist - 2 * np',
        "tests/test_response.py::test_rigid_rows_keep_the_length_of_the_bars",
    ),
    Fault(
        "tensegrity/prisms/stability.py",
        "reshape(-1, 3) @ rotation.T",
        "reshape(-1, 3) @ rotation",
        "tests/test_nodes.py::test_a_square_prism_is_lost_where_its_lowest_eigenvalue_changes_its_sign",
    ),
    Fault(
        "tensegrity/prisms/stability.py",
        'event.load, event.kind == "fold"',
        'event.load, event.kind != "fold"',
        "tests/test_nodes.py::test_thick_prism_first_loses_the_symmetric_fold",
    ),
    Fault(
        "tensegrity/prisms/fold_curve.py",
        '"load": load * prism.k_cross * prism.base',
        '"load": load * prism.k_cross',
        "tests/test_limit.py::test_continued_fold_is_the_fold_of_every_prism_on_the_way",
    ),
    # scenes
    Fault(
        "tensegrity/scenes/clearance.py",
        "(self.pair_gaps(x, pairs) / 2, self.wall_gaps",
        "(self.pair_gaps(x, pairs), self.wall_gaps",
        "tests/test_clearance.py::test_beads_that_move_towards_each_other_are_noticed_in_that_step",
    ),
    Fault(
        "tensegrity/scenes/clearance.py",
        "if moved > of.skin / 4:",
        "if moved > math.inf:",
        "tests/test_clearance.py::test_a_bead_far_away_is_found_when_it_comes",
    ),
    Fault(
        "tensegrity/engine/bonds.py",
        "high.max()]]",
        "high[0]]]",
        "tests/test_ensemble.py::test_every_lane_is_watched_at_both_ends_of_the_domain",
    ),
    Fault(
        "tensegrity/engine/bonds.py",
        "[[low.min()",
        "[[low[0]",
        "tests/test_ensemble.py::test_every_lane_is_watched_at_both_ends_of_the_domain",
    ),
    Fault(
        "tensegrity/scenes/walls.py",
        "beyond = np.maximum(self._beyond(x, numbers), 0)",
        "beyond = np.maximum(-self._beyond(x, numbers), 0)",
        "tests/test_clearance.py::test_an_unlisted_wall_is_noticed",
    ),
    Fault(
        "tensegrity/scenes/chain.py",
        "2 * (stiffness * self._largest_mobilities).max()",
        "(stiffness * self._largest_mobilities).max()",
        "tests/test_integrate.py::test_stability_limit_on_both_sides",
    ),
    Fault(
        "tensegrity/scenes/scene.py",
        "        w[list(self.held)] = 0\n",
        "",
        "tests/test_lattice.py::test_mixed_chain_follows_newton",
    ),
    # runs
    Fault(
        "tensegrity/runs/guard.py",
        "np.any(met[:, 1] >= self.domains[:, 1])",
        "np.any(met[:, 1] >= 1.01 * self.domains[:, 1])",
        "tests/test_search.py::test_an_elongation_at_an_end_of_a_domain_is_not_inside",
    ),
    Fault(
        "tensegrity/runs/guard.py",
        "high >= highest",
        "high >= 1.01 * highest",
        "tests/test_integrate.py::test_a_spring_pulled_to_the_upper_end_of_its_domain_ends_the_run_there",
    ),
    Fault(
        "tensegrity/runs/stepping.py",
        "    np.maximum(ranges[:, 0], scene.closing / 2, out=ranges[:, 0])\n",
        "",
        "tests/test_network.py::test_a_spinning_bond_runs_though_its_energy_could_close_it",
    ),
    Fault(
        "tensegrity/runs/judge.py",
        "        return max(errors) * _doubt(1 / gaps[-1][0]) if self.opens else errors[-1]\n",
        "        return min(errors) if self.opens else errors[-1] / 1e3\n",
        "tests/test_integrate.py::test_how_much_an_error_estimate_trusts_the_order",
    ),
    Fault(
        "tensegrity/prisms/condensed.py",
        "            or self._widest(lambda part: (low, high * part))\n",
        "",
        "tests/test_elastic_chain.py::"
        "test_members_far_softer_than_the_cross_strings_move_as_the_equilibria_say",
    ),
    Fault(
        "tensegrity/runs/tolerance.py",
        "first.complete and (length := rests(problem, first.samples[0])):",
        "False and (length := rests(problem, first.samples[0])):",
        "tests/test_rest.py::test_a_scene_at_rest_stays_where_it_is",
    ),
    Fault(
        "tensegrity/runs/step.py",
        "max(2 * steps, count(problem, known))",
        "2 * steps",
        "tests/test_drive_steps.py::test_steps_follow_dashpots_far_stiffer_than_the_springs",
    ),
    Fault(
        "tensegrity/scenes/signals.py",
        "    leaves = 4.0\n",
        "    leaves = np.inf\n",
        "tests/test_drive_steps.py::test_tolerances_hold_where_a_drive_is_sampled",
    ),
    Fault(
        "tensegrity/runs/step.py",
        "        omega = max(omega, quickest(functions_of_time(problem.scene), problem.t_end))\n",
        "        omega = omega\n",
        "tests/test_drive_steps.py::test_steps_follow_a_drive_far_quicker_than_the_springs",
    ),
    Fault(
        "tensegrity/runs/judge.py",
        "(TREATED if treated else 1))",
        "(TREATED if treated else 4))",
        "tests/test_integrate.py::test_contacts_that_open_are_trusted_with_the_order_they_leave",
    ),
    Fault(
        "tensegrity/runs/motion.py",
        "if not (finite and self._allows(self._range_met, end)):",
        "if not self._allows(self._range_met, end):",
        "tests/test_march.py::test_a_run_that_overflows_is_told_as_in_short_attempts",
    ),
    Fault(
        "tensegrity/runs/motion.py",
        "return self._guard.is_inside(met) and self._guard.allows(met)",
        "return self._guard.is_inside(met)",
        "tests/test_march.py::test_what_is_too_stiff_for_the_step_is_told_as_in_short_attempts",
    ),
    Fault(
        "tensegrity/scenes/clearance.py",
        "kept | (room[1:] > 0)",
        "kept | (room[:-1] > 0)",
        "tests/test_march.py::test_what_touches_at_the_end_of_a_step_is_found_by_a_look_after_each",
    ),
    Fault(
        "tensegrity/scenes/clearance.py",
        "kept = ways < room[:-1]",
        "kept = ways < np.inf",
        "tests/test_march.py::test_contacts_that_are_not_listed_are_found_between_instants",
    ),
    Fault(
        "tensegrity/scenes/following.py",
        "(self.wall_gaps(x, ends), self.hold(x), inside)",
        "(self.hold(x), inside)",
        "tests/test_following.py::test_a_run_in_one_call_sees_the_end_of_a_wall",
    ),
    Fault(
        "tensegrity/scenes/following.py",
        "np.asarray(self.skin / 2 - moved)",
        "np.asarray(np.inf - moved)",
        "tests/test_following.py::test_an_attempt_that_passes_its_list_is_made_again",
    ),
    Fault(
        "tensegrity/scenes/following.py",
        "all(map(np.array_equal",
        "any(map(np.array_equal",
        "tests/test_following.py::test_lists_that_are_the_same_are_one_scene",
    ),
    Fault(
        "tensegrity/engine/march.c",
        "none[i % 8] += 0 * x[i]",
        "none[i % 8] += 0",
        "tests/test_march.py::test_a_run_that_overflows_is_told_as_in_short_attempts",
    ),
    Fault(
        "tensegrity/engine/energies.c",
        "stored[set->members[i]] = part[i]",
        "stored[i] = part[i]",
        "tests/test_march.py::test_energies_are_those_of_the_springs_one_by_one",
    ),
    Fault(
        "tensegrity/engine/energies.c",
        "loads[i] * u[i]",
        "loads[i] * v[i]",
        "tests/test_network_energies.py::test_energies_of_rows_are_those_summed_by_hand",
    ),
    Fault(
        "tensegrity/engine/elongations.c",
        "u[second[i] * DIM + k] - u[first[i] * DIM + k]",
        "u[second[i] * DIM + k]",
        "tests/test_network_energies.py::test_energies_of_rows_are_those_summed_by_hand",
    ),
    Fault(
        "tensegrity/engine/march.c",
        "return l->show && l->show(l->scene, l->method, u, v);",
        "return 0;",
        "tests/test_integrate.py::test_each_recorded_row_is_where_a_run_that_ends_there_ends",
    ),
    Fault(
        "tensegrity/prisms/fit.py",
        "return np.asarray(np.sqrt(np.maximum(inside, 0.0)))",
        "return np.asarray(np.sqrt(2 * np.maximum(inside, 0.0)))",
        "tests/test_fit.py::test_squares_of_the_band_add_up_to_a_noise_for_each_parameter",
    ),
    Fault(
        "tensegrity/runs/fitted.py",
        "low, high = low - room, high + room",
        "low, high = low + room, high + room",
        "tests/test_polynomial.py::test_a_range_left_is_widened",
    ),
    Fault(
        "tensegrity/runs/tuning.py",
        "self._values(self._rates, t)[:, :-2] * (2 / self._t_end)",
        "self._values(self._rates, t)[:, :-2] / self._t_end",
        "tests/test_tuning.py::test_prestrain_drawn_in_does_work_that_the_energy_keeps",
    ),
    Fault(
        "tensegrity/engine/driven.c",
        "if (!(low > d->domain[2 * s] && high < d->domain[2 * s + 1])) return 1;",
        "if (!(low > d->domain[2 * s] && high < d->domain[2 * s + 1])) return 0;",
        "tests/test_tuning.py::test_a_spring_may_use_the_stroke_that_it_has_at_that_instant",
    ),
    # waves
    Fault(
        "tensegrity/waves/asymptotics.py",
        "form.sound_speed().subs(form.spacing, 1) ** 2",
        "form.sound_speed().subs(form.spacing, 1) ** -2",
        "tests/test_waves.py::test_sound_speed_of_a_linear_chain_is_that_of_long_waves",
    ),
    Fault(
        "tensegrity/waves/asymptotics.py",
        'x, "sites"), -spring.domain[0]',
        'x, "sites"), spring.domain[1]',
        "tests/test_waves.py::test_tent_spans_two_sites_and_reaches_the_locking_stroke",
    ),
    Fault(
        "tensegrity/waves/travelling.py",
        "density = rho * self.law.tension(rho) / 2 +",
        "density = rho * self.law.tension(rho) +",
        "tests/test_solitary.py::test_wave_is_the_same_by_speed_amplitude_and_energy",
    ),
    Fault(
        "tensegrity/waves/solitary.py",
        "masses = stiffness / 2 * (grid",
        "masses = stiffness * (grid",
        "tests/test_solitary.py::test_toda_soliton_by_amplitude_has_its_closed_speed_momentum_and_energy",
    ),
    # measure
    Fault(
        "tensegrity/measure/observables.py",
        "inside = slice(low + 1, high + 1)",
        "inside = slice(low + 1, high)",
        "tests/test_observables.py::test_waves_that_overlap_are_cut_at_the_least_elongation_between_them",
    ),
    Fault(
        "tensegrity/measure/observables.py",
        "place=j + 0.5 + shift",
        "place=j + 0.5 - shift",
        "tests/test_observables.py::test_energy_and_momentum_of_two_waves_far_apart",
    ),
    Fault(
        "tensegrity/measure/observables.py",
        "bonds[:, bond + 1 :].sum(axis=1)",
        "bonds[:, bond:].sum(axis=1)",
        "tests/test_budget.py::test_energy_and_momentum_beyond_any_bond_close",
    ),
    Fault(
        "tensegrity/measure/observables.py",
        "[-tension * run.v[:, bond + 1], -tension]",
        "[-tension * run.v[:, bond], -tension]",
        "tests/test_budget.py::test_energy_and_momentum_beyond_any_bond_close",
    ),
    Fault(
        "tensegrity/runs/plotting.py",
        "scene.site_energy(run.u, run.v)",
        "scene.site_energy(run.u, 0 * run.v)",
        "tests/test_plotting.py::test_plot_shows_energy_over_sites_and_time",
    ),
    # granular
    Fault(
        "granular/beads.py",
        "return math.pi / 6 * diameter * diameter",
        "return math.pi / 3 * diameter * diameter",
        "tests/test_granular_contact.py::test_printed_masses_are_density_times_volume_to_one_percent",
    ),
    Fault(
        "granular/beads.py",
        "core.contact_radius + thickness",
        "core.contact_radius",
        "tests/test_granular_contact.py::test_coated_bead_keeps_mass_and_place_of_its_core",
    ),
    Fault(
        "granular/contact.py",
        "** (1 / self.exponent)",
        "** self.exponent",
        "tests/test_granular_chain.py::test_striker_on_a_loaded_chain_starts_without_overlap_and_keeps_the_energy",
    ),
    Fault(
        "granular/chain.py",
        "            energies[..., bead] -= energies[..., wall]\n",
        "",
        "tests/test_granular_chain.py::test_energies_of_the_parts_add_up",
    ),
    Fault(
        "granular/pack.py",
        "wall_gaps=np.zeros(len(touched))",
        "wall_gaps=np.full(len(touched), 1e-6)",
        "tests/test_packs.py::test_the_planar_pack_passes_on_the_reference_s_force[straight]",
    ),
    Fault(
        "granular/statics.py",
        "< 0.5 * np.linalg.norm(f)",
        "< np.inf",
        "tests/test_packs_at_rest.py::test_a_pack_with_small_gaps_settles_until_its_contacts_carry",
    ),
    Fault(
        "granular/statics.py",
        "return pull + scene.loads",
        "return pull - scene.loads",
        "tests/test_packs_at_rest.py::test_a_guide_rests_on_its_end_until_struck",
    ),
    Fault(
        "granular/crystal.py",
        "run.v[:, np.argsort(run.sites)]",
        "run.v",
        "tests/test_granular_chain.py::"
        "test_what_is_told_of_parts_does_not_depend_on_the_order_of_the_record",
    ),
    Fault(
        "granular/lattices.py",
        "d / 2 + d / 2 * (row % 2)",
        "d / 2 + d / 2 * (row % 2 == 0)",
        "tests/test_packs.py::test_the_planar_pack_counts_rows_from_the_top",
    ),
    Fault(
        "tensegrity/scenes/following.py",
        "moved >= (self.skin / 2) ** 2",
        "moved >= np.inf",
        "tests/test_packs.py::test_energies_of_a_gas_count_the_contacts_that_formed",
    ),
    Fault(
        "granular/crystal.py",
        "- (diameters[0] + diameters[-1]) / 2",
        "- diameters[0]",
        "tests/test_granular_chain.py::test_distance_of_beads_of_unequal_diameters_is_that_of_their_centres",
    ),
    Fault(
        "granular/observables.py",
        'facts["peak_heights"] / 4',
        'facts["peak_heights"] / 2',
        "tests/test_granular_chain.py::test_neighbours_are_two_pulses_if_the_force_between_falls_below_three_quarters",
    ),
    Fault(
        "granular/observables.py",
        "LEVEL = 0.05",
        "LEVEL = 0.5",
        "tests/test_granular_chain.py::test_pulses_count_from_a_twentieth_of_the_largest",
    ),
    Fault(
        "granular/layout.py",
        "OPEN = 1.0",
        "OPEN = 0.5",
        "tests/test_granular_layout.py::test_outer_walls_end_a_diameter_behind_the_last_beads_and_a_quarter_before_the_first",
    ),
    Fault(
        "granular/lammps_text.py",
        "constant / math.sqrt(bead.radius)",
        "constant",
        "tests/test_lammps.py::test_files_give_every_contact_the_constant_of_its_spring[pack]",
    ),
    Fault(
        "tensegrity/scenes/forcing.py",
        "    ground[held] = 0.0\n",
        "",
        "tests/test_driven.py::test_a_dashpot_from_a_held_site_to_the_ground_changes_nothing",
    ),
    Fault(
        "tensegrity/prisms/contact.py",
        "(np.clip(s, 0, 1), np.ones(len(x)))",
        "(np.clip(s, 0, 1),)",
        "tests/test_structure_path.py::test_distances_of_bars_are_the_least_of_all_points_of_both",
    ),
    Fault(
        "tensegrity/engine/subnormal.c",
        "was | 0x8040",
        "was",
        "tests/test_subnormal.py::test_what_moves_by_less_than_the_smallest_normal_number_stays",
    ),
    # files of pictures, and the pages made of them
    Fault(
        "figures/_files.py",
        "wanted is None or table in wanted",
        "wanted is None or table not in wanted",
        "tests/test_figures.py::test_any_tables_are_read_as_they_were_written",
    ),
    Fault(
        "docs/claims.py",
        "cells[k] == row",
        "cells[k]",
        "tests/test_claims.py::test_a_number_is_read_with_its_error",
    ),
    Fault(
        "docs/pages.py",
        '.replace("|", r"\\|")',
        "",
        "tests/test_site_pages.py::test_names_of_the_ledger_lead_to_it_and_listed_formulas_are_added",
    ),
    Fault(
        "figures/prism_drawing.py",
        "return b if a == node else a",
        "return a if a == node else b",
        "tests/test_figures.py::test_the_drawn_prism_is_turned_by_150_degrees_and_its_bars_push",
    ),
    # drive, damping, springs in time
    Fault(
        "tensegrity/engine/driven.c",
        "d->sums[0] -= a * d->force_rate[at] * u[q];",
        "d->sums[0] += a * d->force_rate[at] * u[q];",
        "tests/test_driven.py::test_work_is_the_integral_of_the_force_of_the_driver_times_its_velocity",
    ),
    Fault(
        "tensegrity/engine/driven.c",
        "            u[i] += part * y[i];",
        "            u[i] += b * y[i];",
        "tests/test_driven.py::test_dashpots_in_bonds_slow_a_mode_at_the_reference_rate",
    ),
    Fault(
        "tensegrity/engine/timed.py",
        "starts = origin + self._dt * np.arange(first, first + steps + 1)",
        "starts = origin + self._dt * np.arange(first, first + steps + 1) + self._dt",
        "tests/test_driven.py::test_a_mass_on_a_shaken_base_follows_the_closed_form",
    ),
    Fault(
        "tensegrity/engine/driven.c",
        "share = 1 / (finer * finer - 1);",
        "share = 1 / (finer - 1);",
        "tests/test_driven.py::test_dashpots_in_bonds_that_turn_agree_with_another_integrator",
    ),
    Fault(
        "tensegrity/runs/forced.py",
        "self._bound.sums[:] = self.point.sums",
        "self._bound.sums[:] = 0.0",
        "tests/test_driven_runs.py::test_a_broken_run_goes_on_to_the_same_bits",
    ),
    Fault(
        "tensegrity/runs/recorder.py",
        "sums[:, k].reshape(len(t), -1).sum(axis=1) for k",
        "sums[:, k].reshape(len(t), -1)[:, 0] for k",
        "tests/test_driven_runs.py::test_rows_in_a_file_are_those_in_memory",
    ),
    # where waves start
    Fault(
        "tensegrity/waves/excess.py",
        "p = float(powers[k]) + 1",
        "p = float(powers[k]) + 2",
        "tests/test_prediction.py::"
        "test_waves_start_from_rest_whatever_the_power_that_stiffens_the_spring[6]",
    ),
    # corners of forces
    Fault(
        "tensegrity/springs/kinks.py",
        "strength = jump * side ** abs(k - 1) / math.factorial(max(k - 1, 0))",
        "strength = jump / math.factorial(max(k - 1, 0))",
        "tests/test_corners.py::test_corners_of_a_law",
    ),
    Fault(
        "tensegrity/springs/kinks.py",
        "found.append((next_one, exponent + 1))",
        "found.append((one, exponent))",
        "tests/test_corners.py::test_a_tension_without_its_corners_has_none[cubes]",
    ),
    Fault(
        "tensegrity/engine/line_openings.c",
        "w[start + i] = side[i] * ((u[i + LANES] - u[i]) - place[i]);",
        "w[start + i] = side[i] * ((u[i + LANES] - u[i]) - o->place[i]);",
        "tests/test_corners.py::test_all_corners_of_a_law_are_corrected[gap]",
    ),
    Fault(
        "tensegrity/engine/net_openings.c",
        "w[j + i] = o->side[j + i] * (r[i] - o->place[j + i]);",
        "w[j + i] = o->side[b + i] * (r[i] - o->place[b + i]);",
        "tests/test_corners.py::test_all_corners_of_a_law_are_corrected[net]",
    ),
    Fault(
        "tensegrity/runs/judge.py",
        "        refuse_jumps(self._problem, met, self._tol)\n",
        "",
        "tests/test_corners.py::test_a_tolerance_is_refused_where_a_force_jumps[away from rest]",
    ),
    # modes and bands
    Fault(
        "tensegrity/waves/spectrum.py",
        "[:, None] * elongation / np.sqrt(m)",
        "[:, None] * elongation / m",
        "tests/test_spectrum.py::test_monatomic_chain_has_the_sine_of_half_the_wavenumber",
    ),
    Fault(
        "tensegrity/waves/spectrum.py",
        "sigma=-SHIFT * scale",
        "sigma=SHIFT * scale",
        "tests/test_spectrum.py::test_finite_chains_have_the_sines_of_their_ends",
    ),
    Fault(
        "tensegrity/waves/spectrum.py",
        "shapes *= np.sign(largest)[:, None]",
        "pass",
        "tests/test_spectrum.py::test_the_largest_entry_of_a_shape_is_above_zero",
    ),
    Fault(
        "tensegrity/waves/spectrum.py",
        "nothing = ZERO * scale",
        "nothing = ZERO * size * scale",
        "tests/test_spectrum.py::"
        "test_the_slowest_wave_of_a_long_chain_is_not_taken_for_rigid_motion",
    ),
)


def chosen(words: list[str]) -> list[Fault]:
    """The faults in whose file or test one of the words occurs; all where there is none."""
    return [f for f in FAULTS if not words or any(w in f.file or w in f.test for w in words)]


def outcome(root: Path, tests: list[str], seconds: float, report: Path | None = None) -> int:
    """What pytest returns for some tests of the tree at `root`, `ENDLESS` after so many seconds.

    All that it started ends with it, and it ends with this process, however that ends.
    """
    path = os.pathsep.join([str(root), str(root / "tests")])
    environment = {**os.environ, "PYTHONPATH": path, "PYTHONDONTWRITEBYTECODE": "1"}
    command = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", *tests]
    command += [] if report is None else [f"--junitxml={report}"]
    child = subprocess.Popen(
        command, cwd=root, env=environment, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True, preexec_fn=_ending_with(os.getpid()),
    )  # fmt: skip
    try:
        return child.wait(seconds)
    except subprocess.TimeoutExpired:
        return ENDLESS
    finally:
        with contextlib.suppress(ProcessLookupError, PermissionError):
            os.killpg(child.pid, signal.SIGKILL)
        child.wait()


def _ending_with(parent: int):
    """What a child does first, so that it does not outlive this process."""
    if not sys.platform.startswith("linux"):
        return None
    prctl = ctypes.CDLL(None).prctl

    def tie() -> None:
        prctl(PDEATHSIG, signal.SIGKILL)
        if os.getppid() != parent:  # it ended before
            os._exit(1)

    return tie


def times(report: Path) -> dict[str, float]:
    """Seconds of each test in a report of pytest: by its file's name and its own."""
    cases = ElementTree.parse(report).iter("testcase")
    found = ((f"{x.get('classname', '').split('.')[-1]}::{x.get('name')}", x) for x in cases)
    return {name: float(x.get("time", 0)) for name, x in found}


def limit(fault: Fault, taken: dict[str, float]) -> float:
    """Seconds after which the test of a fault counts as one that does not end."""
    file, name = fault.test.split("::")
    test = f"{Path(file).stem}::{name}"
    mine = (t for key, t in taken.items() if key == test or key.startswith(f"{test}["))
    return PATIENCE + SLOWER * sum(mine)


def survives(root: Path, fault: Fault, seconds: float = PATIENCE) -> bool:
    """Whether the test of a fault does not notice it in the tree at `root`, left as it was."""
    path = root / fault.file
    source = path.read_text()
    path.write_text(fault.broken(source))
    try:
        return outcome(root, [fault.test], seconds) not in (FAILED, ENDLESS)
    finally:
        path.write_text(source)


def main(words: list[str]) -> int:
    """Try the chosen faults; the number of those that survive, at least 1 if none was tried."""
    parser = argparse.ArgumentParser(prog="python -m tests.faults", description=__doc__)
    parser.add_argument("words", nargs="*", metavar="WORD")
    faults, survivors = chosen(parser.parse_args(words).words), 0
    if not faults:
        print("no fault of that name")
        return 1
    tests = list(dict.fromkeys(f.test for f in faults))
    with tempfile.TemporaryDirectory() as folder:
        root, report = Path(folder) / "tree", Path(folder) / "report.xml"
        shutil.copytree(ROOT, root, ignore=OUTSIDE)
        if outcome(root, tests, PATIENCE * len(tests), report) != 0:
            print("a test fails before any fault")
            return 1
        taken = times(report)
        for fault in faults:
            survived = survives(root, fault, limit(fault, taken))
            survivors += survived
            word = "SURVIVES" if survived else "noticed"
            print(f"{word:8} {fault.file}: {fault.text.strip()}  [{fault.test}]", flush=True)
    print(f"{len(faults) - survivors} of {len(faults)} faults noticed")
    return survivors


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(128 + signal.SIGTERM))  # with its children
    sys.exit(min(main(sys.argv[1:]), 1))
