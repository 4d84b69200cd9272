#include <arpa/inet.h>
#include <netinet/in.h>
#include <sys/socket.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <set>
#include <sstream>
#include <thread>

#include <fmt/format.h>

#include "tests/tools/program.h"

namespace isobrick::test {
namespace {

namespace fs = std::filesystem;

/// A port that was free just now.
int free_port() {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof address;
  ::bind(fd, reinterpret_cast<sockaddr*>(&address), size);
  ::getsockname(fd, reinterpret_cast<sockaddr*>(&address), &size);
  ::close(fd);
  return ::ntohs(address.sin_port);
}

bool accepts(int port) {
  const int fd = ::socket(AF_INET, SOCK_STREAM, 0);
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = ::htonl(INADDR_LOOPBACK);
  address.sin_port = ::htons(static_cast<std::uint16_t>(port));
  const bool connects =
      ::connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0;
  ::close(fd);
  return connects;
}

constexpr const char* kConfiguration = R"(daemon off;
master_process off;
pid {0}/pid;
error_log {0}/error.log;
events {{ worker_connections 256; }}
http {{
  log_format one '$server_protocol $connection $status $request_uri';
  access_log {0}/access.log one;
  client_body_temp_path {0}/body;
  proxy_temp_path {0}/proxy;
  fastcgi_temp_path {0}/fastcgi;
  uwsgi_temp_path {0}/uwsgi;
  scgi_temp_path {0}/scgi;
  server {{
    listen 127.0.0.1:{1};
    listen 127.0.0.1:{2} ssl http2;
    ssl_certificate {0}/certificate.pem;
    ssl_certificate_key {0}/key.pem;
    root {0}/served;
  }}
}}
)";

/// A store that a real web server serves.
class Nginx : public ProgramTest {
 protected:
  void SetUp() override {
    const std::string nginx = available("nginx") ? "nginx" : "/usr/sbin/nginx";
    if (!available(nginx)) GTEST_SKIP() << "nginx is not there";
    if (!available("openssl")) GTEST_SKIP() << "openssl is not there";
    fs::create_directory(path("served"));
    ASSERT_EQ(run({"synth", "gyroid", store(), "--dims", "130,96,90", "--type", "u8", "--brick",
                   "16", "--shard", "64"})
                  .exit_code,
              0);
    const Outcome made = run_process(
        {"openssl", "req", "-x509", "-newkey", "ec", "-pkeyopt", "ec_paramgen_curve:prime256v1",
         "-nodes", "-days", "2", "-subj", "/CN=localhost", "-addext", "subjectAltName=IP:127.0.0.1",
         "-keyout", path("key.pem"), "-out", certificate()});
    ASSERT_EQ(made.exit_code, 0) << made.err;
    // Another process may take a port before nginx does.
    for (int tries = 0; tries < 5 && process_ <= 0; ++tries) start(nginx);
    ASSERT_GT(process_, 0) << read_file(path("error.log"));
  }
  void TearDown() override { stop(); }

  void start(const std::string& nginx) {
    plain_ = free_port();
    secure_ = free_port();
    write_file(path("nginx.conf"), fmt::format(kConfiguration, path("."), plain_, secure_));
    process_ = ::fork();
    if (process_ == 0) {
      ::execlp(nginx.c_str(), nginx.c_str(), "-p", path("").c_str(), "-c",
               path("nginx.conf").c_str(), "-e", path("error.log").c_str(), nullptr);
      ::_exit(127);
    }
    for (int i = 0; i < 500 && ::waitpid(process_, nullptr, WNOHANG) == 0; ++i) {
      if (accepts(plain_) && accepts(secure_)) return;
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    stop();
  }
  void stop() {
    if (process_ <= 0) return;
    ::kill(process_, SIGKILL);
    ::waitpid(process_, nullptr, 0);
    process_ = -1;
  }

  std::string store() const { return path("served/smooth.zarr"); }
  std::string certificate() const { return path("certificate.pem"); }
  std::string plain_url() const { return fmt::format("http://127.0.0.1:{}/smooth.zarr", plain_); }
  std::string secure_url() const {
    return fmt::format("https://127.0.0.1:{}/smooth.zarr", secure_);
  }
  /// Runs an extraction with a variable of the environment, "NAME=VALUE".
  Outcome extract(const std::string& input,
                  const std::string& variable = "NONE=", const Arguments& more = {}) {
    Arguments words{"env",
                    "-u",
                    "SSL_CERT_FILE",
                    "-u",
                    "CURL_CA_BUNDLE",
                    variable,
                    ISOBRICK_PROGRAM,
                    "extract",
                    input,
                    "--isovalue",
                    "127.5",
                    "-o",
                    path("m.ply"),
                    "-f",
                    "-q"};
    words.insert(words.end(), more.begin(), more.end());
    return run_process(words);
  }
  std::string mesh_of(const std::string& input,
                      const std::string& variable = "NONE=", const Arguments& more = {}) {
    const Outcome outcome = extract(input, variable, more);
    EXPECT_EQ(outcome.exit_code, 0) << outcome.err;
    return outcome.exit_code == 0 ? read_file(path("m.ply")) : "";
  }

  /// The requests since the last call, as nginx logs them.
  struct Requests {
    std::set<std::string> protocols, connections;
    int count = 0, unchanged = 0;  ///< … of these answered 304
  };
  Requests take_requests() {
    Requests requests;
    std::istringstream log(read_file(path("access.log")).substr(seen_));
    for (std::string line; std::getline(log, line); ++requests.count) {
      seen_ += line.size() + 1;
      std::string protocol, connection, status;
      std::istringstream(line) >> protocol >> connection >> status;
      requests.protocols.insert(protocol);
      requests.connections.insert(connection);
      requests.unchanged += status == "304";
    }
    return requests;
  }

 private:
  pid_t process_ = -1;
  int plain_ = 0, secure_ = 0;
  std::size_t seen_ = 0;
};

TEST_F(Nginx, MeshesAreThoseOfTheFolder) {
  const std::string expected = mesh_of(store());
  EXPECT_TRUE(mesh_of(plain_url()) == expected);
  const Requests requests = take_requests();
  EXPECT_EQ(requests.protocols, std::set<std::string>{"HTTP/1.1"});
  EXPECT_GT(requests.count, 20);
  ASSERT_EQ(run({"export", store(), path("served/s.zarr.zip")}).exit_code, 0);
  EXPECT_TRUE(mesh_of(plain_url().replace(plain_url().rfind("smooth"), 6, "s") + ".zip") ==
              expected);
  EXPECT_EQ(run({"verify", plain_url()}).exit_code, 0);
}

TEST_F(Nginx, RequestsOfHttp2ShareAConnection) {
  const std::string expected = mesh_of(store());
  for (const char* variable : {"CURL_CA_BUNDLE=", "SSL_CERT_FILE="}) {
    EXPECT_TRUE(mesh_of(secure_url(), variable + certificate()) == expected) << variable;
    const Requests requests = take_requests();
    EXPECT_EQ(requests.protocols, std::set<std::string>{"HTTP/2.0"});
    EXPECT_GT(requests.count, 20);
    EXPECT_EQ(requests.connections.size(), 1u);
  }
}

TEST_F(Nginx, CertificatesAreChecked) {
  expect_refused(extract(secure_url()), 1, {"certificate"});
  expect_refused(extract(secure_url(), "CURL_CA_BUNDLE=" + path("nothing.pem")), 1,
                 {"nothing.pem"});
  EXPECT_EQ(take_requests().count, 0);
}

TEST_F(Nginx, ItSaysWhetherAnObjectChanged) {
  const Arguments cached{"--cache", path("cache"), "--remote-cache", "64M"};
  const std::string expected = mesh_of(plain_url(), "NONE=", cached);
  const int all = take_requests().count;
  EXPECT_TRUE(mesh_of(plain_url(), "NONE=", cached) == expected);
  EXPECT_LE(take_requests().count, 4);
  // Ten minutes later: nothing but the times in the cache tells of them.
  for (const auto& entry : fs::recursive_directory_iterator(path("cache")))
    if (entry.path().filename() == "state.json") {
      auto state = nlohmann::json::parse(read_file(entry.path()));
      state["fresh_until"] = 1;
      write_file(entry.path(), state.dump());
    }
  EXPECT_TRUE(mesh_of(plain_url(), "NONE=", cached) == expected);
  const Requests later = take_requests();
  EXPECT_GT(later.unchanged, 10);
  EXPECT_LT(later.count, all);
  EXPECT_TRUE(mesh_of(plain_url(), "NONE=", cached) == expected);
  EXPECT_LE(take_requests().count, 4);
}

}  // namespace
}  // namespace isobrick::test
