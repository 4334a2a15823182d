"""The hand model: segments, joints, lengths, forward kinematics."""
