#include <isobrick/device_extractor.h>
#include <isobrick/error.h>

// Without CUDA nothing is in device memory, and nobody has any of these.

namespace isobrick::inline v0 {
namespace {

[[noreturn]] void refuse_device() { throw Error("this isobrick was built without CUDA"); }

}  // namespace

struct DeviceExtractor::Impl {};
struct PendingDeviceMesh::Impl {};
struct DeviceMesh::Impl {};

PendingDeviceMesh::PendingDeviceMesh(std::unique_ptr<Impl>) {}
PendingDeviceMesh::~PendingDeviceMesh() = default;
PendingDeviceMesh::PendingDeviceMesh(PendingDeviceMesh&&) noexcept = default;
bool PendingDeviceMesh::is_ready() const { refuse_device(); }
DeviceMesh PendingDeviceMesh::get() { refuse_device(); }

DeviceExtractor::DeviceExtractor(const DeviceArray&) { refuse_device(); }
DeviceExtractor::DeviceExtractor(const StoreReader&, const ExtractOptions&, const DeviceTarget&,
                                 Progress&) {
  refuse_device();
}
DeviceExtractor::~DeviceExtractor() = default;
DeviceExtractor::DeviceExtractor(DeviceExtractor&&) noexcept = default;
DeviceMesh DeviceExtractor::extract(const ExtractOptions&) { refuse_device(); }
PendingDeviceMesh DeviceExtractor::extract_async(const ExtractOptions&) { refuse_device(); }
DeviceMesh extract(const DeviceArray&, const ExtractOptions&) { refuse_device(); }
DeviceMesh extract_to_device(const StoreReader&, const ExtractOptions&, const DeviceTarget&,
                             Progress&) {
  refuse_device();
}

DeviceMesh::DeviceMesh() = default;
DeviceMesh::DeviceMesh(std::shared_ptr<const Impl>) {}
std::span<const Vec3f> DeviceMesh::positions() const { return {}; }
std::span<const Vec3f> DeviceMesh::normals() const { return {}; }
std::span<const Triangle> DeviceMesh::triangles() const { return {}; }
int DeviceMesh::device() const { return -1; }
CUstream_st* DeviceMesh::stream() const { return nullptr; }
CUevent_st* DeviceMesh::ready() const { return nullptr; }
void DeviceMesh::precede(CUstream_st*) const {}
Mesh DeviceMesh::download() const { return {}; }

}  // namespace isobrick
