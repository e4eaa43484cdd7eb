"""What the reader says it is."""

from robot_agent.rfid.llrp.codec import Message, llrp

NOBODY = 0
"""Maker and model numbers are assigned to makers; this reader has none."""
MOST_SPECS = 32


def capabilities(requested: int) -> list[Message]:
    """`requested`: one of the kinds 1 to 4, 0 all of them."""
    kinds = (_general, _llrp, _regulatory, _air)
    return [make() for kind, make in enumerate(kinds, start=1) if requested in (0, kind)]


def _general() -> Message:
    p = llrp()
    return p.GeneralDeviceCapabilities_Parameter(
        MaxNumberOfAntennaSupported=1,
        HasUTCClockCapability=True,
        DeviceManufacturerName=NOBODY,
        ModelName=NOBODY,
        ReaderFirmwareVersion="emulated",
        Parameters=[
            p.ReceiveSensitivityTableEntry_Parameter(Index=1, ReceiveSensitivityValue=0),
            p.GPIOCapabilities_Parameter(),
            p.PerAntennaAirProtocol_Parameter(AntennaID=1, ProtocolID=[1]),
        ],
    )


def _llrp() -> Message:
    return llrp().LLRPCapabilities_Parameter(
        MaxNumPriorityLevelsSupported=1,
        MaxNumROSpecs=MOST_SPECS,
        MaxNumSpecsPerROSpec=MOST_SPECS,
        MaxNumInventoryParameterSpecsPerAISpec=1,
        MaxNumAccessSpecs=MOST_SPECS,
        MaxNumOpSpecsPerAccessSpec=MOST_SPECS,
    )


def _regulatory() -> Message:
    """One power and one channel of the European band."""
    p = llrp()
    mode = p.C1G2UHFRFModeTableEntry_Parameter(
        DRValue=False, BDRValue=64000, PIEValue=2000, MinTariValue=12500, MaxTariValue=25000
    )
    channels = p.FixedFrequencyTable_Parameter(Frequency=[865700])
    band = p.UHFBandCapabilities_Parameter(
        Parameters=[
            p.TransmitPowerLevelTableEntry_Parameter(Index=1, TransmitPowerValue=3000),
            p.FrequencyInformation_Parameter(Hopping=False, Parameters=[channels]),
            p.C1G2UHFRFModeTable_Parameter(Parameters=[mode]),
        ]
    )
    return p.RegulatoryCapabilities_Parameter(CommunicationsStandard=2, Parameters=[band])


def _air() -> Message:
    """No filter: this reader listens to everybody."""
    return llrp().C1G2LLRPCapabilities_Parameter(MaxNumSelectFiltersPerQuery=0)
