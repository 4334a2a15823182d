"""Who may come in and what they may do: the gate, roles, single sign-on, and what the gate reports to the audit trail."""
