"""What goes wrong on the worst day, done to real processes: nothing that was kept may be lost, and every session can be finished afterwards."""
