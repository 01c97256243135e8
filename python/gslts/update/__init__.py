"""The Active Scene Updater: collects views of a change, edits the Gaussians and refines them."""
