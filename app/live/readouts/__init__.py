"""What a live station shows beside the hand: angles, place, grasp, movement, the worn glove, all computed outside the station's tick."""
