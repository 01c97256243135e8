"""
Instruction set of the kernels.
"""
from __future__ import annotations
__all__: list[str] = ['target', 'targets', 'use_target']
def target() -> str:
    """
    Return the name of the instruction set that the kernels use: sse4, avx2, avx512 or neon.
    """
def targets() -> list[str]:
    """
    Return the names of the instruction sets that this machine can use, the best first.
    """
def use_target(name: str) -> None:
    """
    Make the kernels use an instruction set from now on. Call it while no kernel runs.
    
    Args:
        name: One of `targets`.
    
    Raises:
        ValueError: This machine cannot use it.
    """
