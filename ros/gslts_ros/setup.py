"""Installs the launch file and the entry point of the node as a ROS 2 package."""

from pathlib import Path

from setuptools import setup

NAME = "gslts_ros"


def files(folder: str) -> tuple[str, list[str]]:
    """Return where the files of a folder are installed, and their paths."""
    return f"share/{NAME}/{folder}", [str(path) for path in sorted(Path(folder).glob("*.*"))]


setup(
    name=NAME,
    version="0.1.0",
    packages=[NAME],
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{NAME}"]),
        (f"share/{NAME}", ["package.xml"]),
        *map(files, ("config", "launch", "rviz")),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="The gslts developers",
    maintainer_email="gslts@example.org",
    description="Launch file and RViz configuration of the node of gslts.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["gslts_ros = gslts_ros.node:main"]},
)
