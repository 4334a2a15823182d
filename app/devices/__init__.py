"""Gloves: the port, the process that records it, commands, and a virtual glove that speaks the same wire."""
