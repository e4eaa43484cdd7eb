// An LLRP client with another codec (llrpjs): one inventory, then write and read back user memory.
// Usage: node client.cjs PORT EPC WORD...   Prints one JSON object.
const { LLRPClient, LLRPCore } = require("llrpjs");

const [port, epc, ...words] = process.argv.slice(2);
const reader = new LLRPClient({ host: "127.0.0.1", port: Number(port) });
const found = { heard: [], status: [], written: null, read: null };

const list = (x) => (x == null ? [] : Array.isArray(x) ? x : [x]);

reader.on("RO_ACCESS_REPORT", (message) => {
  for (const tag of list(message.toLLRPData().data.TagReportData)) {
    found.heard.push(tag.EPC_96.EPC);
    const { C1G2WriteOpSpecResult: write, C1G2ReadOpSpecResult: read } = tag;
    if (write) found.written = [write.Result, write.NumWordsWritten];
    if (read) found.read = [read.Result, read.ReadData];
  }
});
reader.on("error", (error) => {
  console.error(error);
  process.exit(1);
});

const ask = async (name, data) => {
  const answer = await reader.transact(new LLRPCore[name]({ data }));
  found.status.push(answer.getLLRPStatus().getStatusCode());
  return answer;
};

const target = {
  MB: 1,
  Match: true,
  Pointer: 32,
  TagMask: "ff".repeat(epc.length / 2),
  TagData: epc,
};

(async () => {
  await reader.connect();
  const greeting = await reader.recv(5000);
  found.greeting = greeting.getReaderEventNotificationData().getConnectionAttemptEvent().getStatus();
  const capabilities = await ask("GET_READER_CAPABILITIES", { RequestedData: "All" });
  found.firmware = capabilities.getGeneralDeviceCapabilities().getReaderFirmwareVersion();
  await ask("DELETE_ROSPEC", { ROSpecID: 0 });
  await ask("DELETE_ACCESSSPEC", { AccessSpecID: 0 });
  await ask("ADD_ACCESSSPEC", {
    AccessSpec: {
      AccessSpecID: 5,
      AntennaID: 0,
      ProtocolID: "EPCGlobalClass1Gen2",
      CurrentState: "Disabled",
      ROSpecID: 9,
      AccessSpecStopTrigger: { AccessSpecStopTrigger: "Operation_Count", OperationCountValue: 1 },
      AccessCommand: {
        C1G2TagSpec: { C1G2TargetTag: target },
        C1G2Write: { OpSpecID: 1, AccessPassword: 0, MB: 3, WordPointer: 0, WriteData: words.join("") },
        C1G2Read: { OpSpecID: 2, AccessPassword: 0, MB: 3, WordPointer: 0, WordCount: words.length },
      },
      AccessReportSpec: { AccessReportTrigger: "End_Of_AccessSpec" },
    },
  });
  await ask("ENABLE_ACCESSSPEC", { AccessSpecID: 5 });
  await ask("ADD_ROSPEC", {
    ROSpec: {
      ROSpecID: 9,
      Priority: 0,
      CurrentState: "Disabled",
      ROBoundarySpec: {
        ROSpecStartTrigger: { ROSpecStartTriggerType: "Null" },
        ROSpecStopTrigger: { ROSpecStopTriggerType: "Duration", DurationTriggerValue: 300 },
      },
      AISpec: {
        AntennaIDs: [0],
        AISpecStopTrigger: { AISpecStopTriggerType: "Null", DurationTrigger: 0 },
        InventoryParameterSpec: { InventoryParameterSpecID: 1, ProtocolID: "EPCGlobalClass1Gen2" },
      },
      ROReportSpec: {
        ROReportTrigger: "Upon_N_Tags_Or_End_Of_ROSpec",
        N: 0,
        TagReportContentSelector: {
          EnableROSpecID: true,
          EnableSpecIndex: false,
          EnableInventoryParameterSpecID: false,
          EnableAntennaID: true,
          EnableChannelIndex: false,
          EnablePeakRSSI: false,
          EnableFirstSeenTimestamp: true,
          EnableLastSeenTimestamp: true,
          EnableTagSeenCount: true,
          EnableAccessSpecID: true,
        },
      },
    },
  });
  await ask("ENABLE_ROSPEC", { ROSpecID: 9 });
  await ask("START_ROSPEC", { ROSpecID: 9 });
  await new Promise((resolve) => setTimeout(resolve, 600));
  const refused = await reader.transact(new LLRPCore.START_ROSPEC({ data: { ROSpecID: 77 } }));
  found.refused = refused.getLLRPStatus().getStatusCode();
  await ask("DELETE_ROSPEC", { ROSpecID: 9 });
  await ask("CLOSE_CONNECTION", {});
  console.log(JSON.stringify(found));
  process.exit(0);
})().catch((error) => {
  console.error(error);
  process.exit(1);
});
