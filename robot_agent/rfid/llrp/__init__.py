"""LLRP, the protocol of UHF readers (EPCglobal Low Level Reader Protocol 1.0.1), by pyllrp."""
