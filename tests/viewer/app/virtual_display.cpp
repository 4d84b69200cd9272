#include "tests/viewer/app/virtual_display.h"

#include <X11/Xatom.h>
#include <X11/Xlib.h>
#include <X11/Xutil.h>
#include <X11/extensions/XTest.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdlib>
#include <stdexcept>

// glfw3native.h needs headers of XRandR for this.
extern "C" Window glfwGetX11Window(GLFWwindow* window);

namespace isobrick::inline v0 {

struct VirtualDisplay::State {
  pid_t server = -1;
  Display* display = nullptr;
  std::string before;

  /// ICCCM 4.1.3.1: notifies a window that it is minimised.
  void set_state(Window window, long value) const {
    const Atom name = XInternAtom(display, "WM_STATE", False);
    const long state[] = {value, None};
    XChangeProperty(display, window, name, name, 32, PropModeReplace,
                    reinterpret_cast<const unsigned char*>(state), 2);
    XSync(display, False);
  }

  ~State() {
    if (display != nullptr) XCloseDisplay(display);
    if (server > 0) {
      kill(server, SIGTERM);
      waitpid(server, nullptr, 0);
    }
    setenv("DISPLAY", before.c_str(), 1);
  }
};

bool VirtualDisplay::available() { return std::system("command -v Xvfb >/dev/null 2>&1") == 0; }

VirtualDisplay::VirtualDisplay(int width, int height, int dots_per_inch)
    : state_(std::make_unique<State>()) {
  if (const char* display = std::getenv("DISPLAY")) state_->before = display;
  int pipes[2];
  if (pipe(pipes) != 0) throw std::runtime_error("no pipe");
  const std::string screen = std::to_string(width) + "x" + std::to_string(height) + "x24";
  const std::string number = std::to_string(pipes[1]);
  state_->server = fork();
  if (state_->server == 0) {
    close(pipes[0]);
    prctl(PR_SET_PDEATHSIG, SIGTERM);  // a test that crashes leaves no server behind
    execlp("Xvfb", "Xvfb", "-displayfd", number.c_str(), "-screen", "0", screen.c_str(),
           "-nolisten", "tcp", "+extension", "GLX", static_cast<char*>(nullptr));
    _exit(127);
  }
  close(pipes[1]);
  std::string name = ":";
  for (char c = 0; read(pipes[0], &c, 1) == 1 && c != '\n';) name += c;
  close(pipes[0]);
  if (name == ":") throw std::runtime_error("Xvfb did not start");
  setenv("DISPLAY", name.c_str(), 1);
  state_->display = XOpenDisplay(nullptr);
  if (state_->display == nullptr) throw std::runtime_error("no connection to Xvfb");
  // Desktops set the display's scale here; GLFW reads it.
  const std::string resources = "Xft.dpi:\t" + std::to_string(dots_per_inch) + "\n";
  XChangeProperty(state_->display, DefaultRootWindow(state_->display), XA_RESOURCE_MANAGER,
                  XA_STRING, 8, PropModeReplace,
                  reinterpret_cast<const unsigned char*>(resources.data()),
                  static_cast<int>(resources.size()));
  XSync(state_->display, False);
}

VirtualDisplay::~VirtualDisplay() = default;

void VirtualDisplay::minimise(GLFWwindow* window) {
  const Window name = glfwGetX11Window(window);
  XUnmapWindow(state_->display, name);
  state_->set_state(name, IconicState);
}

void VirtualDisplay::restore(GLFWwindow* window) {
  const Window name = glfwGetX11Window(window);
  XMapWindow(state_->display, name);
  state_->set_state(name, NormalState);
}

void VirtualDisplay::focus_under_pointer() {
  XSetInputFocus(state_->display, PointerRoot, RevertToPointerRoot, CurrentTime);
  XSync(state_->display, False);
}

unsigned long VirtualDisplay::pixel(GLFWwindow* window, int x, int y) {
  XImage* const image =
      XGetImage(state_->display, glfwGetX11Window(window), x, y, 1, 1, AllPlanes, ZPixmap);
  if (image == nullptr) throw std::runtime_error("nothing can be read from the window");
  const unsigned long value = XGetPixel(image, 0, 0);
  XDestroyImage(image);
  return value & 0xffffff;
}

void VirtualDisplay::move_pointer(int x, int y) {
  XTestFakeMotionEvent(state_->display, -1, x, y, CurrentTime);
  XSync(state_->display, False);
}

void VirtualDisplay::button(int number, bool down) {
  XTestFakeButtonEvent(state_->display, static_cast<unsigned>(number), down ? True : False,
                       CurrentTime);
  XSync(state_->display, False);
}

void VirtualDisplay::key(unsigned long keysym, bool down) {
  XTestFakeKeyEvent(state_->display, XKeysymToKeycode(state_->display, keysym), down ? True : False,
                    CurrentTime);
  XSync(state_->display, False);
}

}  // namespace isobrick
