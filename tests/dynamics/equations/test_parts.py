"""No public graph of a mechanism has more operations than a graph of which it is a part."""

from collections.abc import Callable
from functools import cache

import numpy as np
from pytest import mark, param

import cgraph as cg
import dynamics as dyn
from tests.dynamics.mechanisms import floating, random_mechanism
from tests.dynamics.multibody.test_units import random_tree


def dense(mechanism: dyn.Mechanism) -> cg.Graph:
    return dyn.forward_dynamics(mechanism, "dense")


def with_momenta(mechanism: dyn.Mechanism) -> cg.Graph:
    return dyn.momentum_rate(mechanism, keep_momentum=True)


# Each has the other among its outputs, or is the other where some inputs are 0 and terms are added: bias at qdd = 0,
# gravity at qd = 0, momentum M qd without gravity. No part of one another are the Coriolis matrix and the bias, which
# has gravity, the regressor and inverse dynamics, which has armature, damping and numbers of bodies folded, and the
# linear form and forward dynamics, whose terms that are linear have slopes that are numbers. One exception is known:
# what slides carry at general angles is summed in closed forms, and is not in inverse dynamics.
WHOLES: dict[Callable[[dyn.Mechanism], cg.Graph], tuple[Callable[[dyn.Mechanism], cg.Graph], ...]] = {
    dyn.gravity_force: (dyn.bias, dyn.inverse_dynamics, dyn.forward_dynamics),
    dyn.bias: (dyn.inverse_dynamics, dyn.forward_dynamics, dense),
    dyn.momentum: (dyn.inverse_dynamics, with_momenta),
    dyn.mass_matrix: (dyn.inverse_dynamics_derivatives, dense),
    dyn.inverse_dynamics: (dyn.inverse_dynamics_derivatives,),
    dyn.inverse_mass_matrix: (dyn.state_space,),
    dyn.forward_dynamics: (dyn.state_equation,),
    dyn.kinetic_energy: (dyn.energy,),
    dyn.potential_energy: (dyn.energy,),
}


SUMMED = (dyn.inverse_dynamics, dyn.inverse_dynamics_derivatives)


def mechanisms(seed: int) -> list[dyn.Mechanism]:
    """A tree of hinges, slides, screws and welds, an arm in a plane, and a tree on a free body or a ball."""
    rng, kinds = np.random.default_rng(seed), ["revolute", "prismatic", "screw"]
    n = 1 + seed % 5
    free = floating(("free", "ball")[seed % 2], random_mechanism(1 + seed % 3, list(rng.choice(kinds, 3)), 2, seed))
    plane = dyn.planar_arm(rng.uniform(0.5, 2.0, n), rng.uniform(0.5, 2.0, n))
    return [random_tree(seed, 2 + seed % 4), plane, free]


@mark.parametrize("seed", [0, 1, *[param(seed, marks=mark.slow) for seed in range(2, 40)]])
def test_a_part_has_no_more_operations_than_the_whole(seed: int) -> None:
    for mechanism in mechanisms(seed):

        @cache
        def operations(graph: Callable[[dyn.Mechanism], cg.Graph], of: dyn.Mechanism = mechanism) -> int:
            return len([node for node in graph(of).nodes if node.args])

        slides = any(body.joint.kind == "prismatic" for body in mechanism.bodies)
        for part, wholes in WHOLES.items():
            for whole in wholes:
                if slides and (part, whole) == SUMMED:
                    continue
                assert operations(part) <= operations(whole), (mechanism, part, whole)
