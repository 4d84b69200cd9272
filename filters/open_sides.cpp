#include "filters/open_sides.h"

#include <algorithm>
#include <bit>
#include <utility>

namespace isobrick::inline v0 {
namespace {

/// Reads one sorted run through a buffer of its own.
template <class Side>
class RunReader {
 public:
  RunReader(ScratchArray<Side>& file, std::uint64_t begin, std::uint64_t end, std::uint64_t buffer)
      : file_(file), next_(begin), end_(end), buffer_sides_(buffer) {
    fill();
  }
  bool ended() const { return at_ == buffer_.size(); }
  const Side& side() const { return buffer_[at_]; }
  void advance() {
    if (++at_ == buffer_.size()) fill();
  }

 private:
  void fill() {
    buffer_.clear();
    at_ = 0;
    const std::uint64_t until = std::min(end_, next_ + buffer_sides_);
    file_.for_each_run(next_, until, [&](std::span<const Side> run, std::uint64_t) {
      buffer_.insert(buffer_.end(), run.begin(), run.end());
    });
    next_ = until;
  }

  ScratchArray<Side>& file_;
  std::uint64_t next_, end_, buffer_sides_;
  std::vector<Side> buffer_;
  std::size_t at_ = 0;
};

}  // namespace

// The table takes half, and the two files, of which one is read and one written, the rest.
template <class Number>
OpenSides<Number>::OpenSides(const ScratchPlace& place, std::uint64_t memory)
    : max_table_(std::bit_floor(std::max<std::uint64_t>(16, memory / 2 / sizeof(Side)))),
      runs_file_(place, memory / 8),
      merged_file_(place, memory / 8) {
  // Small at first, so that the processor's cache holds it.
  make_table(std::min<std::size_t>(max_table_, 4096));
}

template <class Number>
std::uint64_t OpenSides<Number>::memory() const {
  // Merging buffers as much of the runs as their file holds, or a side each.
  return max_table_ * sizeof(Side) + 2 * runs_file_.memory() + merged_file_.memory() +
         kFanIn * sizeof(Side);
}

template <class Number>
void OpenSides<Number>::make_table(std::size_t size) {
  table_.assign(size, {});
  table_shift_ = 64 - static_cast<unsigned>(std::countr_zero(size));
  waiting_ = 0;
}

template <class Number>
void OpenSides<Number>::add_side(Number from, Number to) {
  const bool ascends = from < to;
  insert({ascends ? from : to, ascends ? to : from}, ascends ? 1 : -1);
}

template <class Number>
void OpenSides<Number>::insert(const VertexPair<Number>& key, std::int64_t excess) {
  const std::size_t mask = table_.size() - 1;
  std::size_t i = home_of(key);
  while (table_[i].excess != 0 && table_[i].key != key) i = (i + 1) & mask;
  Side& side = table_[i];
  if (side.excess == 0) {
    side = {key, excess};
    if (++waiting_ > table_.size() / 2) grow_or_spill();
    return;
  }
  side.excess += excess;
  if (side.excess == 0) erase(i);
}

template <class Number>
void OpenSides<Number>::erase(std::size_t hole) {
  const std::size_t mask = table_.size() - 1;
  // What follows moves up unless that would be before its own place.
  for (std::size_t i = (hole + 1) & mask; table_[i].excess != 0; i = (i + 1) & mask)
    if (((i - home_of(table_[i].key)) & mask) >= ((i - hole) & mask)) {
      table_[hole] = table_[i];
      hole = i;
    }
  table_[hole] = {};
  --waiting_;
}

template <class Number>
void OpenSides<Number>::grow_or_spill() {
  if (table_.size() >= max_table_) return spill();
  std::vector<Side> old = std::move(table_);
  // Both tables are there for a moment, and the files take nothing yet.
  make_table(2 * old.size());
  for (const Side& side : old)
    if (side.excess != 0) insert(side.key, side.excess);
}

template <class Number>
void OpenSides<Number>::spill() {
  if (runs_.size() == kFanIn) {
    const std::uint64_t begin = merged_file_.size();
    merge_runs([&](const Side& side) { merged_file_.push_back(side); });
    std::swap(runs_file_, merged_file_);
    merged_file_.clear();
    runs_ = {{begin, runs_file_.size()}};
  }
  const auto end = std::partition(table_.begin(), table_.end(),
                                  [](const Side& side) { return side.excess != 0; });
  std::sort(table_.begin(), end, [](const Side& a, const Side& b) { return a.key < b.key; });
  const std::uint64_t begin = runs_file_.size();
  runs_file_.append({table_.data(), static_cast<std::size_t>(end - table_.begin())});
  runs_.push_back({begin, runs_file_.size()});
  std::fill(table_.begin(), end, Side{});
  waiting_ = 0;
  ++spills_;
}

template <class Number>
void OpenSides<Number>::merge_runs(const std::function<void(const Side&)>& f) {
  std::vector<RunReader<Side>> readers;
  for (const Run& run : runs_) readers.emplace_back(runs_file_, run.begin, run.end, buffer_sides());
  const auto first = [&] {
    RunReader<Side>* least = nullptr;
    for (RunReader<Side>& reader : readers)
      if (!reader.ended() && (!least || reader.side().key < least->side().key)) least = &reader;
    return least;
  };
  for (RunReader<Side>* reader = first(); reader;) {
    Side side = reader->side();
    reader->advance();
    while ((reader = first()) && reader->side().key == side.key) {
      side.excess += reader->side().excess;
      reader->advance();
    }
    if (side.excess != 0) f(side);
  }
}

template <class Number>
void OpenSides<Number>::for_each(const std::function<void(const Side&)>& f) {
  add_last();
  if (waiting_ > 0) spill();
  merge_runs(f);
}

template <class Number>
void OpenSides<Number>::release() {
  table_ = {};
  runs_file_.release();
  merged_file_.release();
  runs_ = {};
}

template class OpenSides<std::uint32_t>;
template class OpenSides<std::uint64_t>;

}  // namespace isobrick
