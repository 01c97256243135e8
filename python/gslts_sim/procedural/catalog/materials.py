"""Materials that many things share; texels are 0.5 to 2 mm, finer on what is small."""

from __future__ import annotations

from gslts_sim.procedural import textures
from gslts_sim.procedural.model import Kit, Material
from gslts_sim.procedural.noise import Colour, tinted

WHITE: Colour = (0.93, 0.92, 0.89)
BLACK: Colour = (0.13, 0.13, 0.14)
STEEL: Colour = (0.7, 0.71, 0.72)
BRASS: Colour = (0.76, 0.6, 0.32)
SHADE: Colour = (0.95, 0.88, 0.74)


def wood(kit: Kit) -> Material:
    """The wood of most furniture in the home."""
    return kit.material(textures.wood, 0.6, 512, *kit.style.wood)


def second_wood(kit: Kit) -> Material:
    """Another wood, for small things and contrasts."""
    return kit.material(textures.wood, 0.4, 384, *kit.style.second_wood)


def fabric(kit: Kit) -> Material:
    """The cloth of sofas and beds."""
    return kit.material(textures.woven, 0.32, 384, *kit.style.fabric, 96)


def second_fabric(kit: Kit) -> Material:
    """Another cloth, for armchairs and curtains."""
    return kit.material(textures.woven, 0.32, 384, *kit.style.second_fabric, 96)


def print_cloth(kit: Kit, variant: int = 0) -> Material:
    """Cloth with a pattern in the home's accents; `variant` picks another pattern."""
    style = kit.style
    ground: Colour = (0.92, 0.89, 0.82)
    first, second = style.accent, style.second_accent
    if variant % 2:
        ground, first = first, ground
    motif = (style.motif + variant) % 6
    return kit.material(textures.patterned, 0.4, 384, ground, first, second, motif)


def painted(kit: Kit, colour: Colour) -> Material:
    """Painted wood."""
    return kit.material(textures.painted_wood, 0.5, 256, colour)


def metal(kit: Kit, colour: Colour = STEEL) -> Material:
    """Brushed metal."""
    return kit.material(textures.metal, 0.25, 256, colour)


def plastic(kit: Kit, colour: Colour) -> Material:
    """Moulded plastic or enamel, finely grained."""
    lighter = tinted(colour, 1.15, 0.04)
    return kit.material(textures.speckled, 0.08, 128, colour, lighter, 0.3)


def fleck(kit: Kit, colour: Colour, second: Colour, share: float = 0.22) -> Material:
    """Earthenware, skin or enamel with dots of a second colour."""
    return kit.material(textures.speckled, 0.1, 192, colour, second, share)
