"""Files of models: MJCF and URDF, read and written, and MuJoCo twins."""
