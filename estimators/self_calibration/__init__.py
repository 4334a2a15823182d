"""Self-calibration by maximum a posteriori estimation (Kortier, thesis, chapter 4).

problem            knowns, unknowns and their increments: (4.1)-(4.5), (4.8)-(4.10)
residuals          residuals and their derivatives: (4.8)-(4.17)
normal_equations   the sparse linear system of one iteration
solver             Levenberg-Marquardt: (4.7), (4.19)
segments           sensor-to-segment alignment and lengths from a solution: (4.2), (4.3)
uncertainty        covariances of the parameters
whole_hand         all fingers in one problem
sliding_window     the same while the hand moves

docs/methods/map.md has equation -> function -> test.
"""
