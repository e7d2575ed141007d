"""Pictures of grains and walls."""
