"""The wizard that leads a session: a state machine without a GUI, clock or device. Pages only draw it.

transition_table   states and actions; `TRANSITIONS[state][action]` is the next state
state              the wizard's values at one moment, and what can be done in it
machine            the step from one state to the next; it returns the effects
effects            what the station carries out after a step, a type an effect
progress_time      progress of a pose or a trial
texts              title and sentence of every state

What the patient does within a trial is no state: phases, metronome, contacts that are held for
calibration and scores are fields of a task's file (app/protocols, such as touch_table.json).
"""
