"""Each sensor against itself: what its accelerometer, gyroscope and magnetometer say of each other, and the rows of the file."""
