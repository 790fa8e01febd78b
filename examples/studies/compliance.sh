#!/usr/bin/env bash
# The question of IMECE2013-64815: what does each joint's compliance do to the position of the tool?
# Six stiffnesses, each from half to twice the paper's; 2 s of the Greek key, the motion imposed; 1024 variants.
#   examples/studies/compliance.sh [FOLDER [OPTIONS OF mbexport sweep]]
set -euo pipefail
mbexport sweep imece2013 --level compliant --motion greca --duration 2 \
    --vary joint_compliance.stiffness@all=0.5:2 --sample sobol --count 1000 --seed 2013 \
    -o "${1:-compliance-study}" "${@:2}"
