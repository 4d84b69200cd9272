#pragma once

#include <exception>
#include <functional>
#include <string>
#include <string_view>

// SIGINT and SIGTERM. The first one makes the progress calls throw, so that destructors remove what
// is unfinished. Some work calls no progress, such as the encoding of a brick or a driver that
// draws: when the program is still there after a moment, it is ended as it stands.

namespace isobrick::tools {

/// Thrown out of the progress calls after SIGINT or SIGTERM, so that everything
/// on the way out removes its temporary files.
class Interrupted : public std::exception {
 public:
  explicit Interrupted(int signal) : signal_(signal) {}
  int signal() const { return signal_; }
  const char* what() const noexcept override { return "interrupted"; }

 private:
  int signal_;
};

/// From now on SIGINT and SIGTERM are handled as above; a second one kills at once. `command` is
/// for messages. A file size limit becomes an ordinary write error.
void set_up_signals(std::string_view command);
/// The signal that came first, or 0.
int interrupting_signal();
void throw_if_interrupted();

/// From now on an interrupt is reported with the text that `note` returns: what is left, and how to
/// go on. It is called from any thread.
void set_interrupt_note(std::function<std::string()> note);

/// From now on an interrupt is not reported: another process of the same command does that.
void mute_interrupts();

/// Reports the interrupt and ends the program as the signal would have ended it, so that shells see
/// it. Returns only if the signal is ignored.
void end_by_signal(int signal);
/// The command has ended by itself: signals change nothing any more.
void end_interrupts();

}  // namespace isobrick::tools
