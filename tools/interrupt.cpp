#include "tools/interrupt.h"

#include <semaphore.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <mutex>
#include <system_error>
#include <thread>

#include "core/cancel.h"
#include "io/bytes/leftovers.h"
#include "tools/console.h"

namespace isobrick::tools {
namespace {

/// Time for an orderly end; a user waits a second.
constexpr std::chrono::milliseconds kGrace{600};

volatile std::sig_atomic_t g_signal = 0;
sem_t g_came;
/// Set by the thread that ends the program; every other one waits for that.
std::atomic_flag g_ending;

struct Report {
  std::mutex mutex;
  std::string command;
  std::function<std::string()> note;
  bool is_mute = false;
};

/// Never destroyed: the watching thread may outlive main().
Report& report() {
  static Report* const instance = new Report;
  return *instance;
}

void claim_end() {
  if (!g_ending.test_and_set()) return;
  for (;;) ::pause();
}

void print_note() {
  Report& r = report();
  const std::lock_guard lock(r.mutex);
  if (r.is_mute) return;
  if (::isatty(STDERR_FILENO) == 1) std::fputs("\r\x1b[K", stderr);  // the rest of a bar
  print_error(r.command,
              "interrupted; " + (r.note ? r.note()
                                        : "what was not finished is removed; run it "
                                          "again, with --force where an output is there"));
}

void watch() {
  while (sem_wait(&g_came) != 0) {
  }
  std::this_thread::sleep_for(kGrace);
  end_by_signal(g_signal);
}

}  // namespace

int interrupting_signal() { return g_signal; }

void throw_if_interrupted() {
  if (g_signal != 0) throw Interrupted(g_signal);
}

void set_up_signals(std::string_view command) {
  report().command = command;
  sem_init(&g_came, 0, 0);
  try {
    std::thread(watch).detach();
  } catch (const std::system_error&) {
    // Without the thread an interrupt is handled where the command looks for one.
  }
  struct sigaction action {};
  action.sa_handler = [](int signal) {
    g_signal = signal;
    request_cancel();
    sem_post(&g_came);
  };
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_RESTART);
  sigaction(SIGINT, &action, nullptr);
  sigaction(SIGTERM, &action, nullptr);
  // A file that outgrows its limit is an error with a line, not a death.
  std::signal(SIGXFSZ, SIG_IGN);
}

void set_interrupt_note(std::function<std::string()> note) {
  const std::lock_guard lock(report().mutex);
  report().note = std::move(note);
}

void mute_interrupts() {
  const std::lock_guard lock(report().mutex);
  report().is_mute = true;
}

void end_by_signal(int signal) {
  claim_end();
  remove_unfinished();
  print_note();
  std::signal(signal, SIG_DFL);
  std::raise(signal);
}

void end_interrupts() { claim_end(); }

}  // namespace isobrick::tools
