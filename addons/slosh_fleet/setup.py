"""Installs slosh_fleet as an ament package."""

from package_setup import install

install(
    ["matplotlib", "numpy>=1.26"],
    extras={
        "fleet": ["duckdb>=1.2", "fsspec", "pyarrow"],
        "pdf": ["fpdf2>=2.8"],
        "storage": ["s3fs"],
    },
    add_on="fleet = slosh_fleet.addon:ADDON",
)
