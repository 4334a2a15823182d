"""The 3-D scene: a hand made of smooth skinned surfaces, drawn by viser, reached only through the application's own port."""
