"""What a live station shows beside the hand: angles, place, grasp, movement, all computed outside the station's tick."""
