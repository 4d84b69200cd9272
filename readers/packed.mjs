// Decodes bricks of the codec isobrick.packed, for zarrita; docs/reference/packed_codec.md in
// Isobrick's repository specifies the bytes.

const arrays = {
  uint8: Uint8Array, int8: Int8Array, uint16: Uint16Array, int16: Int16Array,
  uint32: Uint32Array, int32: Int32Array, float32: Float32Array, float64: Float64Array,
  uint64: BigUint64Array, int64: BigInt64Array,
};

const bitCount = (bits) => {
  let count = 0;
  for (; bits; bits &= bits - 1n) ++count;
  return count;
};

// Numbers of any size as BigInt: short, not fast.
function number(bytes, at, size) {
  let value = 0n;
  for (let i = size - 1; i >= 0; --i) value = (value << 8n) | BigInt(bytes[at + i]);
  return value;
}

// The codes of a block's 32 groups, by plane and column.
function readCodes(bytes, size, groups) {
  const codes = new Array(4096).fill(0n);
  const heads = [];
  let at = 0;
  for (let group = 0; group < 32; ++group) {
    if (!((groups >> BigInt(group)) & 1n)) continue;
    heads.push({ group, present: number(bytes, at, size), sparse: number(bytes, at + size, size) });
    at += 2 * size;
  }
  let planes = at;
  for (const { sparse } of heads) planes += 2 * bitCount(sparse);
  for (const { group, present, sparse } of heads)
    for (let plane = 0n; plane < BigInt(8 * size); ++plane) {
      if (!((present >> plane) & 1n)) continue;
      let columns = 0xffff;
      if ((sparse >> plane) & 1n) {
        columns = bytes[at] | (bytes[at + 1] << 8);
        at += 2;
      }
      for (let x = 0; x < 16; ++x) {
        if (!((columns >> x) & 1)) continue;
        const rows = bytes[planes++];
        for (let y = 0; y < 8; ++y)
          if ((rows >> y) & 1) codes[group * 128 + y * 16 + x] |= 1n << plane;
      }
    }
  return codes;
}

// The 16³ integers of a block, x fastest.
function decodeBlock(bytes, size) {
  const bits = 8 * size;
  const base = number(bytes, 0, size);
  if (bytes.length === size) return new Array(4096).fill(base);
  const axes = bytes[size];
  const codes = readCodes(bytes.subarray(size + 5), size, number(bytes, size + 1, 4));
  const values = codes.map((code) =>
    code === 1n ? 1n << BigInt(bits - 1) : code & 1n ? -(code >> 1n) : code >> 1n);
  for (let axis = 0; axis < 3; ++axis) {
    if (!((axes >> axis) & 1)) continue;
    const step = 16 ** axis;
    for (let i = 0; i < 4096; ++i)
      if (Math.floor(i / step) % 16 > 0) values[i] += values[i - step];
  }
  return values.map((value) => BigInt.asUintN(bits, value + base));
}

/** Samples of a brick [z, y, x], from its bytes without the crc32c at their end. */
export function decode(bytes, shape, dataType) {
  if (bytes[0] !== 1) throw new Error(`packed by version ${bytes[0]}, not 1`);
  const entries = bytes[2] | (bytes[3] << 8);
  const [depth, height, width] = shape;
  const blocks = shape.map((extent) => Math.ceil(extent / 16));
  const samples = new arrays[dataType](depth * height * width);
  const size = samples.BYTES_PER_ELEMENT;
  if (bytes[1] === 0) {
    new Uint8Array(samples.buffer).set(bytes.subarray(4));
    return samples;
  }
  const target = new DataView(samples.buffer);
  const table = 4 + 4 * blocks[0] * blocks[1] * blocks[2];
  const palette = bytes.subarray(table, table + entries * size);
  const first = table + entries * size;
  const top = 1n << BigInt(8 * size - 1);
  const sampleOf = (value) => {
    if (entries) return number(palette, Number(value) * size, size);
    if (!dataType.startsWith("float")) return value;
    return value & top ? value ^ top : BigInt.asUintN(8 * size, ~value);
  };
  let begin = first;
  for (let block = 0; 4 + 4 * block < table; ++block) {
    const end = first + Number(number(bytes, 4 + 4 * block, 4));
    const values = decodeBlock(bytes.subarray(begin, end), bytes[1]);
    begin = end;
    const x0 = 16 * (block % blocks[2]);
    const y0 = 16 * (Math.floor(block / blocks[2]) % blocks[1]);
    const z0 = 16 * Math.floor(block / (blocks[2] * blocks[1]));
    values.forEach((value, i) => {
      const x = x0 + (i & 15), y = y0 + ((i >> 4) & 15), z = z0 + (i >> 8);
      if (x >= width || y >= height || z >= depth) return;
      const at = ((z * height + y) * width + x) * size;
      const sample = sampleOf(value);
      for (let k = 0; k < size; ++k) target.setUint8(at + k, Number((sample >> BigInt(8 * k)) & 255n));
    });
  }
  return samples;
}

/** A codec for zarrita's registry. */
export class PackedCodec {
  kind = "array_to_bytes";

  constructor({ dataType, shape }) {
    this.dataType = dataType;
    this.shape = shape;
  }
  static fromConfig(configuration, meta) {
    if (configuration.version !== 1) throw new Error(`version ${configuration.version}, not 1`);
    return new PackedCodec(meta);
  }
  encode() {
    throw new Error("isobrick convert --codec packed encodes");
  }
  decode(bytes) {
    const [, height, width] = this.shape;
    const data = decode(bytes, this.shape, this.dataType);
    return { data, shape: this.shape, stride: [height * width, width, 1] };
  }
}
