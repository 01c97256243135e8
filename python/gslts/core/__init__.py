"""Values that every part shares: Gaussian maps, cameras, poses, frames and the robot protocol."""
