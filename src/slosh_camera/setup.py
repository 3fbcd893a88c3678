"""Installs slosh_camera as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop

PACKAGE = "slosh_camera"


class Develop(develop):
    """Setuptools command that makes linked programs use Python from PATH, as setup.cfg does."""

    def install_wrapper_scripts(self, dist):
        """Writes the program scripts."""
        from setuptools.command.develop import VersionlessRequirement
        from setuptools.command.easy_install import ScriptWriter

        header = ScriptWriter.get_header("", "/usr/bin/env python3")
        for arguments in ScriptWriter.get_args(VersionlessRequirement(dist), header):
            self.write_script(*arguments)


setup(
    name=PACKAGE,
    cmdclass={"develop": Develop},
    version=ElementTree.parse("package.xml").findtext("version"),
    packages=find_packages(exclude=["test"]),
    package_data={PACKAGE: ["py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{PACKAGE}"]),
        (f"share/{PACKAGE}", ["package.xml"]),
    ],
    install_requires=[
        "setuptools",
        "numba",
        "numpy>=1.26",
        "opencv-python-headless>=4.6",
        "scipy",
    ],
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Measures a liquid's free surface in camera images.",
    license="Apache-2.0",
    entry_points={"console_scripts": ["camera = slosh_camera.nodes.camera_node:main"]},
)
