"""Installs slosh_plan as an ament package."""

from package_setup import install

install(
    ["numpy>=1.26", "scipy"],
    extras={
        "notebook": ["matplotlib", "pandas"],
        "page": ["jinja2", "matplotlib"],
        "plan": ["casadi"],
    },
    programs=[
        "planner = slosh_plan.nodes.planner_node:main",
        "predictor = slosh_plan.nodes.predictor_node:main",
    ],
)
