"""Where in a map a picture was taken, if nobody knows."""
