#!/usr/bin/env bash
# Guess: MuJoCo computes in float64 with the center of mass that the file has: a pendulum of 0.9 um weighs m g 0.9 um.
# Fact: it weighs nothing. Where the inertial frame is less than a micrometre from the body's, `body_sameframe` says that
#   they are one, and the offset is dropped from then on, though `body_ipos` still shows it; at 2 um the torque is right
#   to all digits. The threshold is absolute, in whatever unit lengths are. With `body_sameframe` set to 0 it is right, too.
# Matters to: whoever models in a unit other than the metre, or small machines, and to whoever compares torques with
#   another library: in a public arm of 25 joints one such link of 10 g takes 1.4e-10 off the torques.
# Versions: mujoco 4.0.0. Date: 2026-11-30.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q mujoco==4.0.0
"$folder/venv/bin/python" - <<'PYTHON'
import mujoco

TEXT = """<mujoco><worldbody><body><joint axis="0 1 0"/>
<inertial pos="{} 0 0" mass="1" diaginertia="1e-3 1e-3 1e-3"/></body></worldbody></mujoco>"""


def weight(length, apart=False):
    model = mujoco.MjModel.from_xml_string(TEXT.format(length))
    if apart:
        model.body_sameframe[:] = 0
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    share = -data.qfrc_bias[0] / (9.81 * length)
    print(f"center {length:g} m off, body_ipos {model.body_ipos[1][0]:g} m: torque {share:.12g} of m g l")
    return share


print("mujoco", mujoco.__version__)
assert weight(9e-7) == 0.0
assert abs(weight(2e-6) - 1.0) < 1e-12
assert abs(weight(9e-7, apart=True) - 1.0) < 1e-12
PYTHON
