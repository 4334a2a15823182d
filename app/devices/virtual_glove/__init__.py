"""A glove without hardware: a simulated wearer or a recording behind the same wire protocol, on a pseudo-terminal."""
