// A holder that clips a sensor board onto a finger: print in TPU 95A, flat side down, without supports. All lengths in mm.
// One a phalanx; a set for a hand is 15 (and 2 larger ones for the back of the hand and the forearm).

finger_width = 18;     // of the phalanx where it sits, measured with callipers; index about 18, little about 15, thumb about 21
finger_height = 15;    // the same, from the back to the palm side
coverage = 250;        // degrees of the finger that the clip goes around: it opens to the palm
wall = 1.6;
length = 9;            // along the finger; shorter than the phalanx by 15 at least, so that joints stay free
board = [9, 11, 0.8];  // sensor board: across, along the finger, thickness
chip_height = 1.2;     // tallest part on it
slack = 0.15;          // between board and pocket
wire = 2.2;            // width of the slot for the strip's wires, at both ends

module ring_section() {
    difference() {
        scale([1, (finger_height + 2 * wall) / (finger_width + 2 * wall)]) circle(d = finger_width + 2 * wall, $fn = 96);
        scale([1, finger_height / finger_width]) circle(d = finger_width, $fn = 96);
        opening = 360 - coverage;
        polygon([[0, 0], for (a = [-90 - opening / 2 : opening / 8 : -90 + opening / 2]) 2 * finger_width * [cos(a), sin(a)]]);
    }
}

module pocket() {
    depth = board[2] + chip_height;
    top = finger_height / 2 + wall;
    difference() {
        translate([-board[0] / 2 - wall, top - wall, 0]) cube([board[0] + 2 * wall, depth + 2 * wall, board[1] + 2 * wall]);
        translate([-board[0] / 2 - slack, top, wall - slack]) cube([board[0] + 2 * slack, depth + slack, board[1] + 2 * slack]);
        translate([-board[0] / 2 + 0.6, top + depth, wall + 0.6]) cube([board[0] - 1.2, 3 * wall, board[1] - 1.2]); // the board snaps under a lip
        translate([-wire / 2, top, -1]) cube([wire, depth + 3 * wall, board[1] + 2 * wall + 2]);
    }
}

union() {
    linear_extrude(max(length, board[1] + 2 * wall)) ring_section();
    pocket();
}
