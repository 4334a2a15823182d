"""What a method made of a recording, checked by everything that shows whether it is to be trusted."""
