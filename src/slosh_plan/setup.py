"""Installs slosh_plan as an ament package."""

from xml.etree import ElementTree

from setuptools import find_packages, setup
from setuptools.command.develop import develop

PACKAGE = "slosh_plan"


class Develop(develop):
    """Makes linked programs use the Python of PATH, as setup.cfg does for installed ones."""

    def install_wrapper_scripts(self, dist):
        """Writes the scripts that start the package's programs."""
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
    install_requires=["setuptools", "numba", "numpy>=1.26", "scipy"],
    extras_require={
        "notebook": ["matplotlib", "pandas"],
        "plan": ["casadi"],
        "page": ["jinja2", "matplotlib"],
    },
    zip_safe=False,
    maintainer="Slosh Monitor maintainers",
    maintainer_email="slosh-monitor@users.noreply.github.com",
    description="Predicts the sloshing of planned motions, and how fast they may be run.",
    license="Apache-2.0",
    entry_points={
        "console_scripts": [
            "governor = slosh_plan.nodes.governor_node:main",
            "planner = slosh_plan.nodes.planner_node:main",
            "predictor = slosh_plan.nodes.predictor_node:main",
            "relay = slosh_plan.nodes.relay_node:main",
        ]
    },
)
