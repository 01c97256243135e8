"""Speed against accuracy of rendering and mapping."""
