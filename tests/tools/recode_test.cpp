#include <filesystem>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Recode : public ProgramTest {
 protected:
  static void succeed(const Arguments& arguments) {
    const Outcome outcome = run(arguments);
    ASSERT_EQ(outcome.exit_code, 0) << outcome.err;
  }
  /// A store of the field with several levels and an index.
  std::string make(const std::string& type, const std::string& name,
                   const Arguments& more = {"--codec", "zstd"},
                   const std::string& kind = "gyroid") {
    Arguments arguments{"synth", kind,      path(name), "--dims",        "100,70,90", "--type",
                        type,    "--brick", "32",       "--build-index", "octree",    "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    succeed(arguments);
    return path(name);
  }
  /// Every file of a store with its bytes, joined; those of indices too, or not.
  static std::string content(const std::string& folder, bool index = true) {
    std::vector<std::string> names;
    for (const auto& entry : fs::recursive_directory_iterator(folder))
      if (entry.is_regular_file() &&
          (index || entry.path().string().find("/index/") == std::string::npos))
        names.push_back(fs::relative(entry.path(), folder).string());
    std::sort(names.begin(), names.end());
    std::string all;
    for (const std::string& name : names) all += name + '\n' + read_file(fs::path(folder) / name);
    return all;
  }
  void expect_same_outputs(const std::string& a, const std::string& b) {
    for (const std::string& store : {a, b}) {
      succeed({"verify", store});
      succeed(
          {"extract", store, "--isovalue", "50%", "--normals", "-o", store + ".ply", "--force"});
      succeed({"export", store, store + ".raw", "--force"});
      succeed({"export", store, store + ".1.raw", "--level", "1", "--force"});
    }
    for (const std::string end : {".ply", ".raw", ".1.raw"})
      EXPECT_TRUE(read_file(a + end) == read_file(b + end)) << b << end;
  }
};

// All of a store's files are those of a conversion by that codec: ranges, histogram, index,
// metadata and bricks.
TEST_F(Recode, MakesWhatAConversionByThatCodecMakes) {
  for (const std::string type : {"u8", "i16", "u32", "f32", "f64"})
    for (const std::string from : {"zstd", "packed", "none"}) {
      const std::string store = make(type, from + ".zarr", {"--codec", from});
      for (const std::string to : {"zstd", "packed", "none"}) {
        const std::string fresh = make(type, to + ".zarr", {"--codec", to});
        succeed({"recode", store, path("r.zarr"), "--codec", to, "--force"});
        // An index is compressed where bricks are when it is made, and is copied as it is.
        const bool index = (from == "none") == (to == "none");
        EXPECT_TRUE(content(path("r.zarr"), index) == content(fresh, index)) << type << from << to;
      }
    }
}

TEST_F(Recode, MeshesAndSamplesAreTheSame) {
  const std::string store = make("i16", "a.zarr");
  for (const std::string codec : {"none", "packed", "zstd:9"}) {
    const nlohmann::json report =
        run_json({"recode", store, path("b.zarr"), "--codec", codec, "--force"});
    EXPECT_EQ(report["command"], "recode");
    EXPECT_EQ(report["codec"], codec);
    EXPECT_EQ(report["codec_sample"], nullptr);
    EXPECT_EQ(run_json({"info", path("b.zarr")})["codec"], codec);
    EXPECT_EQ(run_json({"info", path("b.zarr")})["index_kinds"], nlohmann::json({"octree"}));
    expect_same_outputs(store, path("b.zarr"));
  }
}

TEST_F(Recode, LabelImagesKeepNamesAndColours) {
  const std::string store = make("u16", "a.zarr", {}, "cells");
  nlohmann::json root = nlohmann::json::parse(read_file(store + "/zarr.json"));
  root["attributes"]["ome"]["image-label"]["properties"] = {{{"label-value", 1}, {"name", "one"}}};
  root["attributes"]["ome"]["omero"]["rdefs"]["model"] = "color";
  root["attributes"]["someone"] = {{"else", "s"}};
  write_file(store + "/zarr.json", root.dump(1));
  succeed({"recode", store, path("b.zarr"), "--codec", "packed"});
  EXPECT_EQ(run_json({"info", path("b.zarr")})["labels"], run_json({"info", store})["labels"]);
  const nlohmann::json kept = nlohmann::json::parse(read_file(path("b.zarr") + "/zarr.json"));
  EXPECT_EQ(kept["attributes"]["ome"], root["attributes"]["ome"]);
  EXPECT_EQ(kept["attributes"]["someone"], root["attributes"]["someone"]);
  expect_same_outputs(store, path("b.zarr"));
}

TEST_F(Recode, OfZips) {
  const std::string store = make("u8", "a.zarr");
  succeed({"recode", store, path("b.zarr.zip"), "--codec", "packed"});
  succeed({"recode", path("b.zarr.zip"), path("c.zarr"), "--codec", "zstd"});
  EXPECT_TRUE(content(path("c.zarr")) == content(store));
  succeed({"recode", path("b.zarr.zip"), path("d.ozx"), "--codec", "none"});
  expect_same_outputs(store, path("d.ozx"));
  expect_refused(run({"recode", path("b.zarr.zip"), path("b.zarr.zip"), "--force"}), 2,
                 {"b.zarr.zip", "input"});
}

TEST_F(Recode, OfOmeZarr04) {
  const std::string store = make("u8", "a.zarr", {"--ome", "0.4"});
  expect_refused(run({"recode", store, path("b.zarr"), "--codec", "packed"}), 2, {"OME-Zarr 0.5"});
  EXPECT_FALSE(fs::exists(path("b.zarr.partial")));
  succeed({"recode", store, path("n.zarr"), "--codec", "none"});
  expect_same_outputs(store, path("n.zarr"));
  const nlohmann::json automatic = run_json({"recode", path("n.zarr"), path("z.zarr")});
  EXPECT_EQ(automatic["codec"], "zstd:3");
  EXPECT_EQ(automatic["codec_sample"], nullptr);
  EXPECT_TRUE(content(path("z.zarr")) == content(store));
}

TEST_F(Recode, RefusesWhatConvertRefuses) {
  const std::string store = make("u8", "a.zarr");
  for (const Arguments& more : {Arguments{}, Arguments{"--force"}}) {
    Arguments arguments{"recode", store, store};
    arguments.insert(arguments.end(), more.begin(), more.end());
    expect_refused(run(arguments), 2, {"a.zarr", "input"});
  }
  make("u8", "b.zarr");
  const std::string before = content(path("b.zarr"));
  expect_refused(run({"recode", store, path("b.zarr"), "--codec", "packed"}), 2,
                 {"b.zarr' exists", "--force"});
  EXPECT_TRUE(content(path("b.zarr")) == before);
  succeed({"recode", store, path("b.zarr"), "--codec", "packed", "--force"});
  write_file(path("raw_8x8x8_uint8.raw"), noise(512));
  expect_refused(run({"recode", path("raw_8x8x8_uint8.raw"), path("c.zarr")}), 1, {"raw_8x8x8"});
  expect_refused(run({"recode", path("none.zarr"), path("c.zarr")}), 1, {"none.zarr"});
  expect_refused(run({"recode", store, path("c.ply")}), 2, {"c.ply"});
  expect_refused(run({"recode", store, path("c.zarr"), "--codec", "lz4"}), 2, {"--codec", "lz4"});
  for (const char* factor : {"auto:0", "auto:-1", "auto:x", "auto:", "auto:nan", "auto:inf"})
    expect_refused(run({"recode", store, path("c.zarr"), "--codec", factor}), 2, {"--codec"});
  expect_refused(run({"recode", store, path("c.zarr"), "--memory", "1M"}), 2, {"--memory"});
  EXPECT_FALSE(fs::exists(path("c.zarr.partial")));
}

TEST_F(Recode, NamesWhatIsDamaged) {
  struct Damage {
    std::string file;
    std::size_t from_end;
  };
  for (const Damage& damage :
       {Damage{"/0/c/0/0/0", 3000}, Damage{"/isobrick/0/block_range/c/0/0/0/0", 9},
        Damage{"/isobrick/0/histogram/c/0", 9}, Damage{"/isobrick/0/index/octree/c/0/0/0", 200}}) {
    const std::string store = make("u8", "a.zarr");
    std::string bytes = read_file(store + damage.file);
    ASSERT_GT(bytes.size(), damage.from_end) << damage.file;
    bytes[bytes.size() - damage.from_end] ^= 4;
    write_file(store + damage.file, bytes);
    expect_refused(run({"recode", store, path("b.zarr"), "--codec", "packed", "--force"}), 1,
                   {"a.zarr" + damage.file});
    EXPECT_FALSE(fs::exists(path("b.zarr"))) << damage.file;
  }
  make("u8", "a.zarr");
  fs::remove(path("a.zarr") + "/1/c/0/0/0");
  expect_refused(run({"recode", path("a.zarr"), path("b.zarr"), "--codec", "none", "--force"}), 1,
                 {"a.zarr/1/c/0/0/0"});
}

TEST_F(Recode, AnInterruptedRunIsResumed) {
  succeed({"synth", "gyroid", path("a.zarr"), "--dims", "256,256,256", "--type", "u8", "--brick",
           "32", "--shard", "32"});
  const Arguments slow{"recode", path("a.zarr"), path("b.zarr"), "--codec", "zstd:19", "--threads",
                       "1"};
  const Outcome outcome = run(slow, {.interrupt_after = 1});
  ASSERT_EQ(outcome.signal, 2) << outcome.err;
  EXPECT_NE(outcome.err.find("--resume"), std::string::npos) << outcome.err;
  EXPECT_FALSE(fs::exists(path("b.zarr")));
  expect_refused(run(slow), 2, {"--resume"});
  // Of another store it is not gone on with.
  succeed({"synth", "sphere", path("s.zarr"), "--dims", "256,256,256", "--type", "u8", "--brick",
           "32", "--shard", "32"});
  Arguments other = slow;
  other[1] = path("s.zarr");
  other.push_back("--resume");
  EXPECT_EQ(run(other).exit_code, 1);
  Arguments again = slow;
  again.push_back("--resume");
  const nlohmann::json report = run_json(again);
  EXPECT_GT(report["bricks"]["kept"], 0);
  EXPECT_EQ(report["bricks"]["total"], 512 + 64 + 8 + 1);
  succeed({"recode", path("a.zarr"), path("c.zarr"), "--codec", "zstd:19"});
  EXPECT_TRUE(content(path("b.zarr")) == content(path("c.zarr")));
}

TEST_F(Recode, LittleMemoryAndAnyThreadsChangeNothing) {
  const std::string store = make("f32", "a.zarr");
  succeed({"recode", store, path("b.zarr"), "--codec", "packed"});
  for (const Arguments& more :
       {Arguments{"--threads", "1"}, Arguments{"--threads", "7"}, Arguments{"--memory", "32M"}}) {
    Arguments arguments{"recode", store, path("c.zarr"), "--codec", "packed", "--force"};
    arguments.insert(arguments.end(), more.begin(), more.end());
    succeed(arguments);
    EXPECT_TRUE(content(path("c.zarr")) == content(path("b.zarr"))) << more[1];
  }
}

TEST_F(Recode, AutoChoosesByBytes) {
  // Of smooth samples packed is shorter; of labels zstd is.
  const std::string smooth = make("u8", "a.zarr"), labels = make("u16", "l.zarr", {}, "cells");
  const nlohmann::json a = run_json({"recode", smooth, path("a2.zarr"), "--codec", "auto"});
  EXPECT_EQ(a["codec"], "packed");
  EXPECT_LE(a["codec_sample"]["packed_bytes"], a["codec_sample"]["zstd_bytes"]);
  const nlohmann::json l = run_json({"recode", labels, path("l2.zarr")});
  EXPECT_EQ(l["codec"], "zstd:3");
  EXPECT_GT(l["codec_sample"]["packed_bytes"], l["codec_sample"]["zstd_bytes"]);
  EXPECT_EQ(run_json({"recode", labels, path("l3.zarr"), "--codec", "auto:1000"})["codec"],
            "packed");
  EXPECT_EQ(run_json({"recode", smooth, path("a3.zarr"), "--codec", "auto:0.01"})["codec"],
            "zstd:3");
  const Outcome text = run({"recode", smooth, path("a4.zarr")});
  EXPECT_NE(text.out.find("of the bytes of zstd"), std::string::npos) << text.out;
}

TEST_F(Recode, ConversionsChooseToo) {
  const Arguments dims{"--dims", "100,70,90", "--type", "u8", "--codec", "auto"};
  Arguments synth{"synth", "gyroid", path("a.zarr")};
  synth.insert(synth.end(), dims.begin(), dims.end());
  EXPECT_EQ(run_json(synth)["codec"], "packed");
  succeed({"export", path("a.zarr"), path("a.raw")});
  Arguments convert{"convert", path("a.raw"), path("b.zarr")};
  convert.insert(convert.end(), dims.begin(), dims.end());
  const nlohmann::json from_file = run_json(convert);
  EXPECT_EQ(from_file["codec"], "packed");
  // A stream, which can be read once, is no other case.
  convert[1] = "-";
  convert[2] = path("c.zarr");
  const nlohmann::json from_stream = run_json(convert, {.input = path("a.raw")});
  EXPECT_EQ(from_stream["codec_sample"]["packed_bytes"], from_file["codec_sample"]["packed_bytes"]);
  EXPECT_TRUE(content(path("c.zarr") + "/0/c") == content(path("b.zarr") + "/0/c"));
  convert[1] = path("a.raw");
  convert[2] = path("d.zarr");
  convert.insert(convert.end(), {"--ome", "0.4"});
  EXPECT_EQ(run_json(convert)["codec"], "zstd:3");
}

TEST_F(Recode, PartsHaveOneCodec) {
  write_file(path("n.raw"), noise(20 * 20 * 20));
  for (const Arguments& part : {Arguments{"--part", "1/2"}, Arguments{"--join", "2"}})
    expect_refused(run({"convert", path("n.raw"), path("n.zarr"), "--dims", "20,20,20", "--type",
                        "u8", "--codec", "auto", part[0], part[1]}),
                   2, {"auto", "same codec"});
}

TEST_F(Recode, InfoAdvises) {
  const std::string store = path("a.zarr");
  succeed({"synth", "gyroid", store, "--dims", "128,128,128", "--type", "u8", "--noise", "0.05"});
  EXPECT_EQ(run_json({"info", store})["codec_advice"], nullptr);
  const nlohmann::json info = run_json({"info", store, "--stats"});
  const std::string advice = info["codec_advice"];
  EXPECT_NE(advice.find("isobrick recode " + store + " packed.zarr --codec packed"),
            std::string::npos)
      << advice;
  EXPECT_GT(info["codec_sample"]["bricks"], 0);
  succeed({"export", store, path("a.nrrd")});
  const std::string of_file = run_json({"info", path("a.nrrd"), "--stats"})["codec_advice"];
  EXPECT_NE(of_file.find("isobrick convert " + path("a.nrrd") + " packed.zarr --codec packed"),
            std::string::npos)
      << of_file;
  succeed({"recode", store, path("b.zarr")});
  const std::string none = run_json({"info", path("b.zarr"), "--stats"})["codec_advice"];
  EXPECT_EQ(none.find("isobrick"), std::string::npos) << none;
}

TEST_F(Recode, HasANameOfItsOwnWithoutAnOutput) {
  make("u8", "a.zarr");
  const Outcome outcome = run_process(
      {"env", "-C", path("."), ISOBRICK_PROGRAM, "recode", "a.zarr", "--codec", "none"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_TRUE(fs::exists(path("a_plain.zarr")));
}

}  // namespace
}  // namespace isobrick::test
