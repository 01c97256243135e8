"""Maps that several robots share through a bucket or a folder."""
