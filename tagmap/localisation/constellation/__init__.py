"""Which spots are which tags, from their arrangement alone: as star trackers do, or abstain."""
