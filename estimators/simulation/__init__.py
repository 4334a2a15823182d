"""Forward models that know the truth: motions of a hand, its kinematics, the sensors on it. Never import a tracker from here."""
