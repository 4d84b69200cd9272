#include "surface/chunk_writer.h"

#include "core/stopwatch.h"

namespace isobrick::inline v0 {

ChunkWriter::ChunkWriter(MeshSink& sink) : sink_(sink) {
  free_.push(std::make_shared<Mesh>());
  thread_ = std::thread([this] { run(); });
}

ChunkWriter::~ChunkWriter() {
  if (!thread_.joinable()) return;
  failed_ = true;
  auto stop = std::make_shared<Job>();
  stop->last = true;
  jobs_.push(std::move(stop));
  thread_.join();
}

void ChunkWriter::run() {
  for (;;) {
    std::shared_ptr<Job> job;
    jobs_.pop(job);
    if (job->last) return;
    if (!failed_) try {
        const Stopwatch watch(seconds_);
        sink_.write(job->chunk);
      } catch (...) {
        error_ = std::current_exception();
        failed_ = true;
      }
    // The buffer comes back whatever happened, or the producer would wait for ever.
    job->release();
  }
}

Mesh ChunkWriter::take_free() {
  std::shared_ptr<Mesh> buffer;
  free_.pop(buffer);
  rethrow();
  return std::move(*buffer);
}

void ChunkWriter::rethrow() const {
  if (failed_ && error_) std::rethrow_exception(error_);
}

void ChunkWriter::write(Mesh& mesh, std::uint64_t first_vertex) {
  Mesh next = take_free();
  auto lent = std::make_shared<Mesh>(std::move(mesh));
  mesh = std::move(next);
  const MeshChunk chunk = lent->chunk(first_vertex);
  write(chunk, [this, lent] {
    lent->clear();
    free_.push(lent);
  });
}

void ChunkWriter::write(const MeshChunk& chunk, std::function<void()> release) {
  rethrow();
  bytes_ +=
      chunk.positions.size_bytes() + chunk.normals.size_bytes() + chunk.triangles.size_bytes();
  auto job = std::make_shared<Job>();
  job->chunk = chunk;
  job->release = std::move(release);
  jobs_.push(std::move(job));
}

void ChunkWriter::finish() {
  auto last = std::make_shared<Job>();
  last->last = true;
  jobs_.push(std::move(last));
  thread_.join();
  if (error_) std::rethrow_exception(error_);
}

}  // namespace isobrick
