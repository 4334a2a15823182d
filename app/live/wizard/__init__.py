"""The wizard that leads a session: a state machine without a GUI, clock or device."""
