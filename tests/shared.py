"""What several tests share."""

# The article's targets.
TARGETS = [
    {
        "response": "aor_deg",
        "apparatus": "funnel",
        "value": 32.87,
        "sd": 2.20,
        "repetitions": 10,
        "range": [31.0, 34.0],
    },
    {
        "response": "height_mm",
        "apparatus": "funnel",
        "value": 65.57,
        "sd": 4.10,
        "repetitions": 10,
        "range": [64.0, 69.0],
    },
]
