"""Machine definitions: TOML in, frozen typed models out."""
