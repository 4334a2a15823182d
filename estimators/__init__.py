"""Pure numerics of the hand: arrays in, arrays out; no files, sockets, clocks, web or database.

Conventions (docs/conventions.md), the same everywhere:

    q_ab      Hamilton quaternion [w, x, y, z], takes vectors from frame b to frame a: v_a = rotate(q_ab, v_b); q_ac = q_ab q_bc
    w_ab_b    angular rate of b against a, in b, rad/s
    acc       specific force: a resting sensor reads +g upwards, m/s^2
    G         global frame, z up, heading arbitrary; B segment, S sensor, H hand, p/c parent and child segment, WCS wrist
    arrays    (n, segments, 4), (n, joints, 3), (n, fingers, 3) in the order of hand/anatomy.py: SEGMENTS, JOINTS, FINGERS; NaN = not measured
    units     SI; t in s from the start of the recording; ..._sd is a standard deviation; _deg and _mm only where a person reads

Where an equation of a paper is computed: each page of docs/methods has a table equation -> function -> test
(Kortier, thesis: ch. 2 ekf.md, ch. 4 map.md, ch. 5 magnet.md, ch. 6 forces.md; Salchow-Hoemmen: m1-and-b.md, m2.md).
"""
