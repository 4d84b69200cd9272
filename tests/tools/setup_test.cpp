#include <gtest/gtest.h>
#include <unistd.h>

#include "tests/tools/program.h"

// scripts/setup among stand-ins: whatever it calls is a script of ours that
// records how it was called, and nothing else is in PATH.
namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

class Setup : public ProgramTest {
 protected:
  void SetUp() override {
    fs::create_directory(path("bin"));
    // Others than root must get in.
    fs::permissions(fs::path(path("bin")).parent_path(), fs::perms::all);
    fs::permissions(path("bin"), fs::perms::all);
    fs::copy_file(ISOBRICK_SETUP, path("setup"));
    fs::create_symlink("/usr/bin/env", path("bin/env"));
    for (const char* program :
         {"g++", "cmake", "ninja", "pkg-config", "zstd", "npm", "node", "man"})
      add(program, "");
    add("apt-get", "echo \"$DEBIAN_FRONTEND apt-get $*\" >> " + path("log"));
    add("sudo", "echo \"sudo $*\" >> " + path("log") + "\nexec \"$@\"");
    missing("");
    if (geteuid() == 0 && run_process(as_user({"true"})).exit_code != 0)
      GTEST_SKIP() << "root cannot become another user here";
  }

  /// A program in PATH.
  void add(const std::string& name, const std::string& script) const {
    write_file(path("bin/" + name), "#!/bin/sh\n" + script + "\n");
    fs::permissions(path("bin/" + name), fs::perms::owner_all | fs::perms::group_exec |
                                             fs::perms::group_read | fs::perms::others_exec |
                                             fs::perms::others_read);
  }
  /// These packages, separated by |, are not installed.
  void missing(const std::string& packages) const {
    add("dpkg-query", "case $4 in " + (packages.empty() ? "" : packages + ") exit 1 ;; ") +
                          "*) echo install ok installed ;; esac");
  }

  static Arguments as_user(Arguments words) {
    const Arguments other{"setpriv", "--reuid=65534", "--regid=65534", "--clear-groups"};
    if (geteuid() == 0) words.insert(words.begin(), other.begin(), other.end());
    return words;
  }
  Arguments setup(const Arguments& options) const {
    Arguments words{"/usr/bin/env", "-i", "PATH=" + path("bin"), "/bin/bash", path("setup")};
    words.insert(words.end(), options.begin(), options.end());
    return words;
  }
  Outcome as_user_setup(const Arguments& options = {}) const {
    return run_process(as_user(setup(options)));
  }
  std::string log() const { return fs::exists(path("log")) ? read_file(path("log")) : ""; }
};

constexpr const char* kUpdate = " apt-get update -qq\n";
constexpr const char* kInstall = "apt-get install -y -qq --no-install-recommends ";

TEST_F(Setup, CallsNothingWhenNothingIsMissing) {
  const Outcome outcome = as_user_setup({"--tests"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(outcome.out + outcome.err + log(), "");
}

TEST_F(Setup, InstallsThroughSudo) {
  missing("libisal-dev | libhwy-dev");
  const Outcome outcome = as_user_setup();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_EQ(log(), std::string("sudo apt-get update -qq\n") + kUpdate +
                       "sudo env DEBIAN_FRONTEND=noninteractive " + kInstall +
                       "libisal-dev libhwy-dev\nnoninteractive " + kInstall +
                       "libisal-dev libhwy-dev\n");
}

TEST_F(Setup, RootNeedsNoSudo) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  missing("libisal-dev");
  fs::remove(path("bin/sudo"));
  EXPECT_EQ(run_process(setup({})).exit_code, 0);
  EXPECT_EQ(log(), std::string(kUpdate) + "noninteractive " + kInstall + "libisal-dev\n");
}

TEST_F(Setup, MissingProgramsCountAsWell) {
  fs::remove(path("bin/ninja"));
  EXPECT_EQ(as_user_setup().exit_code, 0);
  EXPECT_NE(log().find(std::string(kInstall) + "ninja-build\n"), std::string::npos) << log();
}

TEST_F(Setup, WithoutSudoItNamesWhatAnAdministratorMustInstall) {
  missing("libisal-dev | libgtest-dev");
  fs::remove(path("bin/sudo"));
  const Outcome outcome = as_user_setup({"--tests"});
  EXPECT_EQ(outcome.exit_code, 1);
  EXPECT_NE(outcome.err.find("apt-get install libisal-dev libgtest-dev"), std::string::npos)
      << outcome.err;
  EXPECT_EQ(log(), "");
}

TEST_F(Setup, ForUsefulThingsAloneNobodyIsAskedForAPassword) {
  fs::remove(path("bin/man"));
  const Outcome outcome = as_user_setup({"--tests"});
  EXPECT_EQ(outcome.exit_code, 0);
  EXPECT_NE(outcome.err.find("man-db"), std::string::npos);
  EXPECT_EQ(log(), "");
}

TEST_F(Setup, FailsOnlyWhenWhatIsNeededCannotBeInstalled) {
  const std::string record = "echo \"$*\" >> " + path("log") + "\n";
  add("apt-get", record + "[ $1 != update ]");  // old package lists may do
  missing("libisal-dev");
  EXPECT_EQ(as_user_setup().exit_code, 0);
  add("apt-get", record + "[ $1 != install ]");
  EXPECT_NE(as_user_setup().exit_code, 0);
  // What is only useful may be unavailable.
  fs::remove(path("bin/man"));
  add("apt-get", record + "case \"$*\" in *man-db*) exit 100 ;; esac");
  const Outcome outcome = as_user_setup({"--tests"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("tests are skipped"), std::string::npos) << outcome.err;
}

TEST_F(Setup, OneUsefulPackageThatCannotBeHadDoesNotLoseTheOthers) {
  if (geteuid() != 0) GTEST_SKIP() << "not root";
  missing("libtiff-dev | libopenvdb-dev | libhdf5-dev");
  add("apt-get",
      "case \"$*\" in *libopenvdb-dev*) exit 100 ;; esac\necho \"$*\" >> " + path("log"));
  const Outcome outcome = run_process(setup({}));
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  for (const char* package : {"libtiff-dev", "libhdf5-dev"})
    EXPECT_NE(log().find(std::string("--no-install-recommends ") + package + "\n"),
              std::string::npos)
        << log();
  EXPECT_NE(outcome.err.find("without libopenvdb-dev some formats"), std::string::npos)
      << outcome.err;
}

TEST_F(Setup, ElsewhereItNamesTheCommandThatInstalls) {
  fs::remove(path("bin/apt-get"));
  fs::remove(path("bin/dpkg-query"));
  Outcome outcome = as_user_setup();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("libisal-dev"), std::string::npos) << outcome.err;

  add("pacman", "[ \"$2\" = fmt ]");  // which is there
  outcome = as_user_setup();
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("needed: pacman -S --needed onetbb libpng nlohmann-json"
                             " cli11 isa-l highway libarchive\n"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("AUR"), std::string::npos) << outcome.err;

  fs::remove(path("bin/ninja"));
  add("dnf", "");
  add("rpm", "[ \"$3\" = json-devel ]");
  outcome = as_user_setup({"--tests"});
  EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
  EXPECT_NE(outcome.err.find("needed: dnf install ninja-build tbb-devel libzstd-devel libpng-devel"
                             " fmt-devel cli11-devel isa-l-devel highway-devel"
                             " libarchive-devel gtest-devel\n"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("pictures, Python and tests: dnf install blosc-devel"),
            std::string::npos)
      << outcome.err;
  EXPECT_NE(outcome.err.find("(Debian's names): libimgui-dev"), std::string::npos) << outcome.err;
  EXPECT_EQ(log(), "");

  add("rpm", "");
  add("ninja", "");
  EXPECT_EQ(as_user_setup({"--tests"}).err, "");
}

}  // namespace
}  // namespace isobrick::test
