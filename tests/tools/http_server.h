#pragma once

#include <csignal>
#include <cstdlib>
#include <sstream>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {

/// http_server.py, which serves a folder while the test runs.
class HttpServer {
 public:
  explicit HttpServer(const std::string& folder) {
    int ends[2];
    if (::pipe(ends) != 0) return;
    process_ = ::fork();
    if (process_ == 0) {
      ::dup2(ends[1], STDOUT_FILENO);
      ::close(ends[0]);
      ::execlp("python3", "python3", ISOBRICK_SOURCE "/tests/tools/http_server.py", folder.c_str(),
               nullptr);
      ::_exit(127);
    }
    ::close(ends[1]);
    std::string text;
    for (char c = 0; ::read(ends[0], &c, 1) == 1 && c != '\n';) text += c;
    ::close(ends[0]);
    port_ = std::atoi(text.c_str());
  }
  ~HttpServer() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
  }
  HttpServer(const HttpServer&) = delete;
  HttpServer& operator=(const HttpServer&) = delete;

  int port() const { return port_; }
  /// The address of a file with what is wrong with it (http_server.py).
  std::string url(const std::string& mode, const std::string& name) const {
    return fmt::format("http://127.0.0.1:{}/{}/{}", port_, mode, name);
  }

  /// Requests and bytes of replies since the last call.
  struct Traffic {
    int requests = 0;
    long bytes = 0;
  };
  /// What the server answers to /requests and so on.
  std::string get(const std::string& name) const {
    return run_process(
               {"python3", "-c",
                "import sys, urllib.request as r; print(r.urlopen(sys.argv[1]).read().decode())",
                fmt::format("http://127.0.0.1:{}/{}", port_, name)})
        .out;
  }
  Traffic take_traffic() const {
    Traffic traffic;
    std::istringstream(get("requests")) >> traffic.requests >> traffic.bytes;
    get("reset");
    return traffic;
  }

 private:
  pid_t process_ = -1;
  int port_ = 0;
};

}  // namespace isobrick::test
