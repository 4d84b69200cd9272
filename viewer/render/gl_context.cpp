#include "viewer/render/gl_context.h"

#include <dlfcn.h>
#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <string_view>
#include <vector>

#include <isobrick/error.h>

namespace isobrick::inline v0 {
namespace {

bool has_word(const char* list, std::string_view word) {
  if (list == nullptr) return false;
  const std::string_view text(list);
  for (std::size_t at = text.find(word); at != text.npos; at = text.find(word, at + 1)) {
    const std::size_t end = at + word.size();
    if ((at == 0 || text[at - 1] == ' ') && (end == text.size() || text[end] == ' ')) return true;
  }
  return false;
}

/// EGL returns the same display for each request of a platform and device, and terminating it ends
/// all contexts on it. So the last owner terminates it.
class Display {
 public:
  explicit Display(EGLDisplay display) : display_(display) {
    const std::lock_guard lock(mutex());
    if (users()[display_]++ == 0 && !eglInitialize(display_, nullptr, nullptr)) {
      users().erase(display_);
      throw Error("it cannot be initialised");
    }
  }
  ~Display() {
    const std::lock_guard lock(mutex());
    if (--users()[display_] > 0) return;
    eglTerminate(display_);
    users().erase(display_);
  }
  Display(const Display&) = delete;
  Display& operator=(const Display&) = delete;

  EGLDisplay get() const { return display_; }

 private:
  static std::mutex& mutex() {
    static std::mutex guard;
    return guard;
  }
  static std::map<EGLDisplay, int>& users() {
    static std::map<EGLDisplay, int> counts;
    return counts;
  }

  EGLDisplay display_;
};

/// A display to try; see candidates() for the order.
struct Candidate {
  EGLenum platform;
  void* device;
  std::string name;
};

std::vector<EGLDeviceEXT> devices() {
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (!has_word(client, "EGL_EXT_platform_device")) return {};
  EGLint count = 0;
  if (!eglQueryDevicesEXT(0, nullptr, &count) || count <= 0) return {};
  std::vector<EGLDeviceEXT> found(static_cast<std::size_t>(count));
  if (!eglQueryDevicesEXT(count, found.data(), &count)) return {};
  found.resize(static_cast<std::size_t>(std::max(count, 0)));
  return found;
}

std::vector<Candidate> candidates() {
  std::vector<Candidate> hardware, software;
  for (const EGLDeviceEXT device : devices()) {
    const bool soft =
        has_word(eglQueryDeviceStringEXT(device, EGL_EXTENSIONS), "EGL_MESA_device_software");
    std::vector<Candidate>& list = soft ? software : hardware;
    list.push_back({EGL_PLATFORM_DEVICE_EXT, device,
                    soft ? "EGL's software device" : fmt::format("EGL device {}", list.size())});
  }
  const char* client = eglQueryString(EGL_NO_DISPLAY, EGL_EXTENSIONS);
  if (has_word(client, "EGL_MESA_platform_surfaceless"))
    hardware.push_back(
        {EGL_PLATFORM_SURFACELESS_MESA, EGL_DEFAULT_DISPLAY, "Mesa without surface"});
  hardware.insert(hardware.end(), software.begin(), software.end());
  return hardware;
}

EGLContext create_context(EGLDisplay display) {
  if (!eglBindAPI(EGL_OPENGL_API)) throw Error("it has no OpenGL");
  const char* extensions = eglQueryString(display, EGL_EXTENSIONS);
  if (!has_word(extensions, "EGL_KHR_surfaceless_context") ||
      !(has_word(extensions, "EGL_KHR_no_config_context") ||
        has_word(extensions, "EGL_MESA_configless_context")))
    throw Error("it draws into windows only");
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                               4,
                               EGL_CONTEXT_MINOR_VERSION,
                               5,
                               EGL_CONTEXT_OPENGL_PROFILE_MASK,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                               EGL_NONE};
  const EGLContext context =
      eglCreateContext(display, EGL_NO_CONFIG_KHR, EGL_NO_CONTEXT, attributes);
  if (context == EGL_NO_CONTEXT) throw Error("it has no OpenGL 4.5");
  return context;
}

}  // namespace

struct GlContext::State {
  explicit State(const Candidate& candidate)
      : display(eglGetPlatformDisplayEXT(candidate.platform, candidate.device, nullptr)),
        context(create_context(display.get())) {}
  ~State() {
    if (eglGetCurrentContext() == context)
      eglMakeCurrent(display.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
    eglDestroyContext(display.get(), context);
  }
  State(const State&) = delete;
  State& operator=(const State&) = delete;

  Display display;
  EGLContext context;
};

GlContext::GlContext() {
  // libepoxy ends the program if it cannot load these libraries.
  for (const char* library : {"libEGL.so.1", "libOpenGL.so.0"})
    if (dlopen(library, RTLD_LAZY | RTLD_LOCAL) == nullptr)
      throw Error(fmt::format(
          "pictures need OpenGL 4.5, but {} cannot be loaded; install a driver with EGL (Debian: "
          "libegl1, libopengl0, libegl-mesa0, libgl1-mesa-dri)",
          library));
  std::string tried;
  for (const Candidate& candidate : candidates()) {
    try {
      state_ = std::make_unique<State>(candidate);
      make_current();
      return;
    } catch (const Error& error) {
      state_.reset();
      tried += fmt::format("{}{}: {}", tried.empty() ? "" : "; ", candidate.name, error.what());
    }
  }
  throw Error(
      fmt::format("pictures need OpenGL 4.5 without a window, and there is none here ({}); install "
                  "a driver with EGL (Debian: libegl-mesa0, libgl1-mesa-dri)",
                  tried.empty() ? "EGL knows no device" : tried));
}

GlContext::~GlContext() = default;

void GlContext::make_current() {
  eglBindAPI(EGL_OPENGL_API);  // per thread
  if (!eglMakeCurrent(state_->display.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, state_->context))
    throw Error("its OpenGL cannot be used in this thread");
}

void GlContext::release_current() {
  eglMakeCurrent(state_->display.get(), EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
}

bool GlContext::available() {
  try {
    const GlContext context;
    return true;
  } catch (const Error&) {
    return false;
  }
}

GlDevice current_gl_device() {
  const auto text = [](GLenum what) {
    const auto* bytes = reinterpret_cast<const char*>(glGetString(what));
    return std::string(bytes == nullptr ? "" : bytes);
  };
  GlDevice device{text(GL_RENDERER), text(GL_VERSION)};
  if (epoxy_gl_version() < 45)
    throw Error(fmt::format("OpenGL 4.5 is needed; '{}' has {}", device.renderer, device.version));
  for (const char* word : {"llvmpipe", "softpipe", "swrast", "SwiftShader"})
    device.software |= device.renderer.find(word) != std::string::npos;
  device.nvidia = text(GL_VENDOR) == "NVIDIA Corporation";
  return device;
}

}  // namespace isobrick
