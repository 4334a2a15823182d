"""What the initial pose was missed by, as gravity in all sensors tells it."""
