// SPDX-FileCopyrightText: 2026 The viso authors
// SPDX-License-Identifier: GPL-3.0-or-later
//
// A session with node-mavlink, whose messages are generated apart from pymavlink's: argument 2 is a port of loopback.
// For ten seconds it asks for telemetry, decodes the stream and sends ODOMETRY; it prints what it met as JSON.

const { connect } = require('net')
const {
  MavLinkPacketParser, MavLinkPacketSplitter, MavLinkProtocolV2, ardupilotmega, common, minimal, send
} = require('node-mavlink')

const REGISTRY = { ...minimal.REGISTRY, ...common.REGISTRY, ...ardupilotmega.REGISTRY }
const DURATION_MS = 10000
const PERIOD_MS = 1000 / 30
const STREAMS_HZ = 4

const met = { decoded: {}, last: {}, unknown: {}, bad_crc: 0, sent: 0 }
const protocol = new MavLinkProtocolV2(255, 190)
const splitter = new MavLinkPacketSplitter({}, {
  onCrcError: () => { met.bad_crc += 1 }
})

function keep (packet) {
  const kind = REGISTRY[packet.header.msgid]
  if (kind === undefined) {
    met.unknown[packet.header.msgid] = true
    return
  }
  const message = packet.protocol.data(packet.payload, kind)
  met.decoded[kind.MSG_NAME] = (met.decoded[kind.MSG_NAME] ?? 0) + 1
  met.last[kind.MSG_NAME] = message
}

function askForStreams (port) {
  const request = new common.RequestDataStream()
  Object.assign(request, { targetSystem: 1, targetComponent: 1, reqStreamId: 0, reqMessageRate: STREAMS_HZ, startStop: 1 })
  return send(port, request, protocol)
}

function askForParameter (port) {
  const request = new common.ParamRequestRead()
  Object.assign(request, { targetSystem: 1, targetComponent: 1, paramId: 'VISO_TYPE', paramIndex: -1 })
  return send(port, request, protocol)
}

function sendOdometry (port) {
  const sample = new common.Odometry()
  const unknown = [NaN, ...new Array(20).fill(0)]
  Object.assign(sample, {
    timeUsec: process.hrtime.bigint() / 1000n,
    frameId: common.MavFrame.LOCAL_FRD,
    childFrameId: common.MavFrame.BODY_FRD,
    x: 1.5, y: -2.5, z: 0.25, q: [1, 0, 0, 0], vx: 0.5, vy: 0, vz: 0, rollspeed: 0, pitchspeed: 0, yawspeed: 0,
    poseCovariance: unknown, velocityCovariance: unknown, resetCounter: 7, estimatorType: 3, quality: 88
  })
  met.sent += 1
  return send(port, sample, protocol)
}

const port = connect({ host: '127.0.0.1', port: Number(process.argv[2]) })
port.on('connect', async () => {
  port.pipe(splitter).pipe(new MavLinkPacketParser()).on('data', keep)
  await askForStreams(port)
  await askForParameter(port)
  const timer = setInterval(() => sendOdometry(port), PERIOD_MS)
  setTimeout(() => {
    clearInterval(timer)
    port.end()
    met.invalid = splitter.invalidPackages
    const text = (_key, value) => typeof value === 'bigint' ? Number(value) : value
    console.log(JSON.stringify(met, text))
    process.exit(0)
  }, DURATION_MS)
})
