"""dynamics: equations of motion on computational graphs, from Lagrangians and bodies."""

from cgraph.extend import doors

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from cgraph import __version__ as __version__

    from . import scenes
    from .equations.constraints.constraint_rank import ConstraintWarning
    from .equations.constraints.integrability import ConstraintLint, integrable_rows, lint_constraints
    from .equations.coriolis import coriolis
    from .equations.energies import energy, kinetic_energy, potential_energy
    from .equations.equations_of_motion import (
        bias,
        damping_force,
        forward_dynamics,
        gravity_force,
        inverse_mass_matrix,
        mass_matrix,
        momentum,
    )
    from .equations.formulations.blame import spurious_nodes
    from .equations.formulations.formulation_sizes import formulation_sizes
    from .equations.formulations.formulations import FORMULATIONS, inverse_dynamics, momentum_rate
    from .equations.formulations.verdict import Verdict, formulation_verdict
    from .equations.linearization.inverse_dynamics_derivatives import inverse_dynamics_derivatives
    from .equations.linearization.linearization import linearize, state_space
    from .equations.linearization.linearize_many import linearize_many
    from .equations.linearization.reduced_linearization import ReducedLinearization, reduced_linearization
    from .equations.mass_matrix.singular_mass_matrix import SingularMassMatrixError, raise_if_singular
    from .equations.momentum.conserved_momenta import conserved_momenta
    from .equations.momentum.hamiltonian import hamilton_equations, hamiltonian
    from .equations.state_equation import state_equation
    from .equations.states.consistent_state import consistent_state
    from .equations.states.evaluate import arrays_at
    from .equations.states.freedom import Freedom, freedom
    from .equations.torque_parts.torque_decomposition import torque_by_joint_motion, torque_by_link
    from .equations.torque_parts.torque_table import TorqueTable
    from .experiments.stability import cases
    from .integrators import METHODS
    from .io.load import load_mjcf, load_urdf
    from .io.write_mjcf import to_mjcf
    from .io.write_urdf import to_urdf
    from .multibody.builders.build_tree import serial_arm, tree
    from .multibody.builders.planar_arm import planar_arm
    from .multibody.changes.impact import Attached, FreeBody, Released, attach_with_impact, release
    from .multibody.changes.pruning import EFFECTS, OmittedTerm, PruneResult, prune
    from .multibody.forces.joint_force import Actuator, JointForce, JointFriction, JointLimit
    from .multibody.quantities.frames import (
        frame_acceleration,
        frame_bias_acceleration,
        frame_jacobian,
        frame_jacobian_rate,
        frame_placement,
        frame_velocity,
    )
    from .multibody.quantities.recursive_inverse_dynamics import RecursiveInverseDynamics
    from .multibody.quantities.regressor import inertial_parameters, regressor
    from .multibody.quantities.whole_body import center_of_mass, center_of_mass_jacobian, spatial_momentum
    from .multibody.trees.mechanism import Body, Force, Joint, Loop, Mechanism, MechanismError, MechanismWarning
    from .multibody.trees.structure import Subtree
    from .multiprecision.reference import reference
    from .multiprecision.solution import Reference
    from .scenes.scenes import Scene
    from .simulation.ensembles.ensemble import Ensemble, EnsembleStats
    from .simulation.ensembles.simulate_many import simulate_many
    from .simulation.events.event import Event
    from .simulation.gradients.gradient import MotionGradient, gradient
    from .simulation.gradients.gradient_many import MotionGradients, gradient_many
    from .simulation.gradients.sensitivities import Sensitivities, sensitivities
    from .simulation.motion_steps import MotionSteps
    from .simulation.outcome import MotionError
    from .simulation.prepare import prepare
    from .simulation.prepared_motion import MotionEnd, PreparedMotion
    from .simulation.sampled_controller import HeldForces, SampledController
    from .simulation.simulate import simulate
    from .simulation.trajectory import Crossings, SimulationWarning, Stats, Trajectory
    from .systems.constraints import ConstraintError
    from .systems.controller import with_controller
    from .systems.display_names import display_names
    from .systems.model import as_system
    from .systems.ode_system import OdeSystem
    from .systems.quasi_velocities import QuasiVelocities
    from .systems.system import System
    from .verification.certificate import certify
    from .verification.residual import Certificate

__all__ = [
    "EFFECTS",
    "FORMULATIONS",
    "METHODS",
    "Actuator",
    "Attached",
    "Body",
    "Certificate",
    "ConstraintError",
    "ConstraintLint",
    "ConstraintWarning",
    "Crossings",
    "Ensemble",
    "EnsembleStats",
    "Event",
    "Force",
    "FreeBody",
    "Freedom",
    "HeldForces",
    "Joint",
    "JointForce",
    "JointFriction",
    "JointLimit",
    "Loop",
    "Mechanism",
    "MechanismError",
    "MechanismWarning",
    "MotionEnd",
    "MotionError",
    "MotionGradient",
    "MotionGradients",
    "MotionSteps",
    "OdeSystem",
    "OmittedTerm",
    "PreparedMotion",
    "PruneResult",
    "QuasiVelocities",
    "RecursiveInverseDynamics",
    "ReducedLinearization",
    "Reference",
    "Released",
    "SampledController",
    "Scene",
    "Sensitivities",
    "SimulationWarning",
    "SingularMassMatrixError",
    "Stats",
    "Subtree",
    "System",
    "TorqueTable",
    "Trajectory",
    "Verdict",
    "arrays_at",
    "as_system",
    "attach_with_impact",
    "bias",
    "cases",
    "center_of_mass",
    "center_of_mass_jacobian",
    "certify",
    "conserved_momenta",
    "consistent_state",
    "coriolis",
    "damping_force",
    "display_names",
    "energy",
    "formulation_sizes",
    "formulation_verdict",
    "forward_dynamics",
    "frame_acceleration",
    "frame_bias_acceleration",
    "frame_jacobian",
    "frame_jacobian_rate",
    "frame_placement",
    "frame_velocity",
    "freedom",
    "gradient",
    "gradient_many",
    "gravity_force",
    "hamilton_equations",
    "hamiltonian",
    "inertial_parameters",
    "integrable_rows",
    "inverse_dynamics",
    "inverse_dynamics_derivatives",
    "inverse_mass_matrix",
    "kinetic_energy",
    "linearize",
    "linearize_many",
    "lint_constraints",
    "load_mjcf",
    "load_urdf",
    "mass_matrix",
    "momentum",
    "momentum_rate",
    "planar_arm",
    "potential_energy",
    "prepare",
    "prune",
    "raise_if_singular",
    "reduced_linearization",
    "reference",
    "regressor",
    "release",
    "scenes",
    "sensitivities",
    "serial_arm",
    "simulate",
    "simulate_many",
    "spatial_momentum",
    "spurious_nodes",
    "state_equation",
    "state_space",
    "to_mjcf",
    "to_urdf",
    "torque_by_joint_motion",
    "torque_by_link",
    "tree",
    "with_controller",
]

if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(__name__, __file__)
