"""Days of robots that keep their maps, judged by what truly happened."""
