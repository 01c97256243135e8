"""Materials that many objects share; texels are 0.5 to 2 mm, finer on small objects."""

from __future__ import annotations

from gslts_sim.procedural import fabrics, textures
from gslts_sim.procedural.model import Kit, Material
from gslts_sim.procedural.noise import Colour, tint

WHITE: Colour = (0.93, 0.92, 0.89)
BLACK: Colour = (0.13, 0.13, 0.14)
STEEL: Colour = (0.7, 0.71, 0.72)
BRASS: Colour = (0.76, 0.6, 0.32)
SHADE: Colour = (0.95, 0.88, 0.74)


def wood(kit: Kit) -> Material:
    """Return the wood of most furniture in the home.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return kit.material(textures.wood, 0.6, 512, *kit.style.wood)


def second_wood(kit: Kit) -> Material:
    """Return another wood, for small things and contrasts.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return kit.material(textures.wood, 0.4, 384, *kit.style.second_wood)


def fabric(kit: Kit) -> Material:
    """Return the cloth of sofas and beds.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return kit.material(fabrics.weave, 0.32, 384, *kit.style.fabric, 96)


def second_fabric(kit: Kit) -> Material:
    """Return another cloth, for armchairs and curtains.

    Args:
        kit: Materials, style and random stream of the home.
    """
    return kit.material(fabrics.weave, 0.32, 384, *kit.style.second_fabric, 96)


def print_cloth(kit: Kit, variant: int = 0) -> Material:
    """Return cloth with a pattern in the home's accents.

    Args:
        kit: Materials, style and random stream of the home.
        variant: Selects the pattern.
    """
    style = kit.style
    ground: Colour = (0.92, 0.89, 0.82)
    first, second = style.accent, style.second_accent
    if variant % 2:
        ground, first = first, ground
    motif = (style.motif + variant) % 6
    return kit.material(fabrics.pattern, 0.4, 384, ground, first, second, motif)


def painted_wood(kit: Kit, colour: Colour) -> Material:
    """Return painted wood.

    Args:
        kit: Materials, style and random stream of the home.
        colour: sRGB.
    """
    return kit.material(textures.painted_wood, 0.5, 256, colour)


def metal(kit: Kit, colour: Colour = STEEL) -> Material:
    """Return brushed metal.

    Args:
        kit: Materials, style and random stream of the home.
        colour: sRGB.
    """
    return kit.material(textures.metal, 0.25, 256, colour)


def plastic(kit: Kit, colour: Colour) -> Material:
    """Return moulded plastic or enamel, finely grained.

    Args:
        kit: Materials, style and random stream of the home.
        colour: sRGB.
    """
    lighter = tint(colour, 1.15, 0.04)
    return kit.material(textures.speckles, 0.08, 128, colour, lighter, 0.3)


def fleck(kit: Kit, colour: Colour, second: Colour, share: float = 0.22) -> Material:
    """Return earthenware, skin or enamel with dots of a second colour.

    Args:
        kit: Materials, style and random stream of the home.
        colour: sRGB.
        second: Second colour, sRGB.
        share: Fraction that the dots cover.
    """
    return kit.material(textures.speckles, 0.1, 192, colour, second, share)
