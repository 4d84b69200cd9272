#include <map>
#include <regex>
#include <set>
#include <sstream>

#include "tests/tools/program.h"

// The same thing has the same name, grammar and default in every subcommand: read from the
// program's definitions, as --help prints them.
namespace isobrick::test {
namespace {

struct Option {
  std::string short_name, value, fallback;
};

/// The options of a subcommand by their long names.
std::map<std::string, Option> options_of(const std::string& help) {
  static const std::regex line(R"(^  (?:(-\w),)?(--[\w-]+)(?: (\S+))?(?:\s{2,}(.*))?$)");
  static const std::regex fallback(R"(.*\[(.*)\](?: \(required\))?$)");
  std::map<std::string, Option> options;
  std::istringstream lines(help);
  std::string text, last;
  while (std::getline(lines, text)) {
    std::smatch match;
    std::string description = text;
    if (std::regex_match(text, match, line)) {
      last = match[2];
      options[last] = {match[1], match[3], ""};
      description = match[4];
    }
    // A long name has its description on the next line.
    if (std::smatch found; !last.empty() && std::regex_match(description, found, fallback))
      options[last].fallback = found[1];
    if (text.empty()) last.clear();
  }
  return options;
}

class Options : public ProgramTest {
 protected:
  std::map<std::string, std::map<std::string, Option>> all() {
    std::map<std::string, std::map<std::string, Option>> commands;
    for (const char* name : {"convert", "info", "index", "verify", "extract", "export", "recode",
                             "render", "view", "synth", "completion", "man", "help"}) {
      const std::string help = run({"help", name}).out;
      if (help.find("not in this program") == std::string::npos) commands[name] = options_of(help);
    }
    return commands;
  }
};

TEST_F(Options, OneNameHasOneGrammarAndOneDefault) {
  // What differs, because it is about another kind of output or another kind of choice.
  const std::set<std::string> other_values{"--format", "--output", "--level"};
  const std::set<std::string> other_defaults{"--format", "--output",     "--isovalue", "--level",
                                             "--size",   "--gpu-memory", "--kind",     "--codec"};
  std::map<std::string, std::pair<std::string, Option>> first;
  int compared = 0;
  for (const auto& [command, options] : all())
    for (const auto& [name, option] : options) {
      const auto [at, is_new] = first.try_emplace(name, command, option);
      if (is_new) continue;
      SCOPED_TRACE(name + " of " + command + " and " + at->second.first);
      const Option& other = at->second.second;
      EXPECT_EQ(option.short_name, other.short_name);
      EXPECT_TRUE(option.value == other.value || other_values.contains(name))
          << option.value << " and " << other.value;
      EXPECT_TRUE(option.fallback == other.fallback || other_defaults.contains(name))
          << option.fallback << " and " << other.fallback;
      ++compared;
    }
  EXPECT_GT(compared, 100);
}

TEST_F(Options, WhatEveryCommandOfAKindHas) {
  const auto commands = all();
  const auto expect = [&](const std::set<std::string>& names,
                          const std::vector<std::string>& options) {
    for (const std::string& name : names) {
      if (!commands.contains(name)) continue;
      for (const std::string& option : options)
        EXPECT_TRUE(commands.at(name).contains(option)) << name << " lacks " << option;
    }
  };
  for (const auto& [name, options] : commands)
    expect({name}, {"--help", "--json", "--quiet", "--progress", "--config"});
  expect({"info", "extract", "export", "view"},
         {"--dims", "--type", "--spacing", "--channel", "--time", "--grid", "--bounds", "--stride",
          "--nodata", "--cache", "--cache-limit", "--memory"});
  expect({"convert", "extract", "export", "view"}, {"--roi", "--region", "--stride", "--nodata"});
  expect({"render"}, {"--region"});
  expect({"extract", "render", "view"}, {"--camera", "--size"});
  expect({"extract", "view"}, {"--search", "--backend", "--gpu-memory", "--inside", "--isovalue"});
  expect({"convert", "synth"}, {"--build-index", "--brick", "--codec"});
  expect({"recode"}, {"--codec", "--resume", "--memory", "--threads"});
  expect({"convert", "synth", "extract", "export", "recode", "render"}, {"--output", "--force"});
  expect({"convert", "synth", "index", "verify", "extract", "export", "view", "info"},
         {"--memory", "--threads"});
  for (const auto& [name, options] : commands)
    for (const auto& [option, letter] : {std::pair{"--output", "-o"}, std::pair{"--quiet", "-q"},
                                         std::pair{"--force", "-f"}, std::pair{"--threads", "-j"}})
      EXPECT_TRUE(!options.contains(option) || options.at(option).short_name == letter)
          << name << " " << option;
}

}  // namespace
}  // namespace isobrick::test
