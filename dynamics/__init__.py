"""dynamics: equations of motion on computational graphs, from Lagrangians and bodies."""

from cgraph._shared import doors

TYPE_CHECKING = False  # as a checker knows it; typing takes a while to load

if TYPE_CHECKING:
    from cgraph import __version__ as __version__

    from . import scenes as scenes
    from .equations.constraints.constraint_rank import ConstraintWarning as ConstraintWarning
    from .equations.equations_of_motion import (
        bias as bias,
        coriolis as coriolis,
        damping_force as damping_force,
        energy as energy,
        forward_dynamics as forward_dynamics,
        gravity_force as gravity_force,
        inverse_mass_matrix as inverse_mass_matrix,
        kinetic_energy as kinetic_energy,
        mass_matrix as mass_matrix,
        momentum as momentum,
        potential_energy as potential_energy,
    )
    from .equations.formulations.formulation_sizes import formulation_sizes as formulation_sizes
    from .equations.formulations.formulations import (
        inverse_dynamics as inverse_dynamics,
        momentum_rate as momentum_rate,
    )
    from .equations.formulations.lagrange_terms import FORMULATIONS as FORMULATIONS
    from .equations.formulations.verdict import (
        Verdict as Verdict,
        formulation_verdict as formulation_verdict,
        spurious_nodes as spurious_nodes,
    )
    from .equations.linearization.inverse_dynamics_derivatives import (
        inverse_dynamics_derivatives as inverse_dynamics_derivatives,
    )
    from .equations.linearization.linearization import (
        linearize as linearize,
        linearize_many as linearize_many,
        reduced_linearization as reduced_linearization,
        state_space as state_space,
    )
    from .equations.mass_matrix.singular_mass_matrix import (
        SingularMassMatrixError as SingularMassMatrixError,
        raise_if_singular as raise_if_singular,
    )
    from .equations.momentum.conserved import conserved as conserved
    from .equations.momentum.hamiltonian import hamilton_equations as hamilton_equations, hamiltonian as hamiltonian
    from .equations.state_equation import state_equation as state_equation
    from .equations.states.consistent_state import consistent_state as consistent_state, freedom as freedom
    from .equations.states.evaluate import arrays_at as arrays_at
    from .equations.torque_parts.torque_table import (
        torque_by_joint_motion as torque_by_joint_motion,
        torque_by_link as torque_by_link,
    )
    from .experiments.stability import cases as cases
    from .integrators import METHODS as METHODS
    from .io.load import load_mjcf as load_mjcf, load_urdf as load_urdf
    from .io.write_mjcf import to_mjcf as to_mjcf
    from .multibody.bodies.body import Limits as Limits
    from .multibody.builders import planar_arm as planar_arm, serial_arm as serial_arm, tree as tree
    from .multibody.changes.impact import attach_with_impact as attach_with_impact, release as release
    from .multibody.changes.pruning import EFFECTS as EFFECTS, prune as prune
    from .multibody.forces.joint_force import (
        Actuator as Actuator,
        JointForce as JointForce,
        JointFriction as JointFriction,
        JointLimit as JointLimit,
        JointSpring as JointSpring,
    )
    from .multibody.quantities.base_parameters import (
        base_parameters as base_parameters,
        inertial_parameters as inertial_parameters,
        regressor as regressor,
    )
    from .multibody.quantities.frames import (
        center_of_mass as center_of_mass,
        center_of_mass_jacobian as center_of_mass_jacobian,
        frame_acceleration as frame_acceleration,
        frame_bias_acceleration as frame_bias_acceleration,
        frame_jacobian as frame_jacobian,
        frame_jacobian_rate as frame_jacobian_rate,
        frame_placement as frame_placement,
        frame_velocity as frame_velocity,
        spatial_momentum as spatial_momentum,
    )
    from .multibody.quantities.torque_causes import torque_by_cause as torque_by_cause
    from .multibody.rows.rows import Rows as Rows
    from .multibody.trees.mechanism import (
        Body as Body,
        Contact as Contact,
        Force as Force,
        Joint as Joint,
        Loop as Loop,
        Mechanism as Mechanism,
        MechanismError as MechanismError,
        MechanismWarning as MechanismWarning,
    )
    from .multibody.trees.structure import Subtree as Subtree
    from .multiprecision.reference import reference as reference
    from .scenes.scenes import Scene as Scene
    from .scenes.start import start as start
    from .simulation.applied_force import SampledController as SampledController
    from .simulation.ensembles.ensemble import Ensemble as Ensemble
    from .simulation.ensembles.simulate_many import simulate_many as simulate_many
    from .simulation.events.event import Event as Event
    from .simulation.gradients.gradient import (
        gradient as gradient,
        gradient_many as gradient_many,
        sensitivities as sensitivities,
    )
    from .simulation.outcome import MotionError as MotionError
    from .simulation.run import Run as Run
    from .simulation.run_options import Options as Options
    from .simulation.simulate import prepare as prepare, simulate as simulate
    from .simulation.trajectory import SimulationWarning as SimulationWarning, Trajectory as Trajectory
    from .systems.constraints import ConstraintError as ConstraintError
    from .systems.controller import with_controller as with_controller
    from .systems.kinematics import QuasiVelocities as QuasiVelocities
    from .systems.model import as_system as as_system, display_names as display_names
    from .systems.ode_system import OdeSystem as OdeSystem
    from .systems.system import System as System
    from .verification.certificate import certify as certify

if not TYPE_CHECKING:  # a checker shall see a misspelt name
    __getattr__, __dir__ = doors(__name__, __file__)
