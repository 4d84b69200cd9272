#include "viewer/app/panels.h"

// Enables operators of ImVec2.
#define IMGUI_DEFINE_MATH_OPERATORS
#include <imgui.h>
#include <imgui_internal.h>

#include <filesystem>
#include <map>
#include <thread>

#include "tests/viewer/app/imgui_version.h"
#include "tests/viewer/app/scene_renderer_fixture.h"

namespace isobrick::inline v0 {
namespace {

/// Panels without a window: frames of Dear ImGui that are not drawn, a pointer and keys.
class Panels : public SceneRendererTest {
 protected:
  void SetUp() override {
    SceneRendererTest::SetUp();
    if (IsSkipped()) return;
    ImGui::CreateContext();
    ImGuiIO& io = ImGui::GetIO();
    io.IniFilename = nullptr;
    io.DisplaySize = {700, 1400};
    io.DeltaTime = 0.3f;  // a click is no double click
    unsigned char* font = nullptr;
    int width = 0, height = 0;
    io.Fonts->GetTexDataAsRGBA32(&font, &width, &height);
    open(SynthKind::sphere, {64, 64, 64});
    state_.path = dir_ / "store.zarr";
    state_.isovalue_stats =
        std::make_unique<IsovalueStats>(std::make_shared<const StoreReader>(dir_ / "store.zarr"));
    state_.settings = settings_;
    state_.navigator.camera = camera_;
    state_.bookmarks = std::make_unique<Bookmarks>(dir_ / "bookmarks.json", dir_ / "store.zarr");
    draw();
    state_.scene_renderer = std::move(scene_renderer_);
    frame();
    ImGuiWindow* panel = ImGui::FindWindowByName("###panel");
    ASSERT_NE(panel, nullptr);
    ImGui::SetWindowSize(panel, {390, 1300});
    for (const char* section :
         {"Camera and look", "Clipping and region", "Slices", "Point and measure", "Bookmarks"})
      panel->StateStorage.SetInt(panel->GetID(section), 1);
    frame();
  }
  void TearDown() override {
    state_.scene_renderer.reset();
    if (ImGui::GetCurrentContext() != nullptr) ImGui::DestroyContext();
    SceneRendererTest::TearDown();
  }

  void frame() {
    ImGui::NewFrame();
    draw_panels(state_);
    ImGui::Render();
  }
  void point(float x, float y) {
    ImGui::GetIO().MousePos = {x, y};
    frame();
  }
  void click(ImVec2 at) {
    point(at.x, at.y);
    ImGui::GetIO().MouseDown[0] = true;
    frame();
    ImGui::GetIO().MouseDown[0] = false;
    frame();
    frame();
  }
  void press(ImGuiKey key) {
    test::hold_key(key, true);
    frame();
    test::hold_key(key, false);
    frame();
  }

  /// Records the widget under each pointer position of a window.
  std::map<ImGuiID, std::vector<ImVec2>> widgets(const char* window = "###panel") {
    std::map<ImGuiID, std::vector<ImVec2>> places;
    const ImGuiWindow* w = ImGui::FindWindowByName(window);
    const ImVec2 from = w->Pos, to = from + w->Size;
    for (float y = from.y + 20; y < to.y; y += kStep)
      for (float x = from.x + 6; x < to.x - 6; x += kAcross) {
        point(x, y);
        if (const ImGuiID id = GImGui->HoveredId) places[id].push_back({x, y});
      }
    return places;
  }
  /// The middle of the widget with this path of IDs.
  ImVec2 place_of(std::initializer_list<const char*> path, std::optional<int> number = {},
                  const char* window = "###panel") {
    ImGuiID id = ImGui::FindWindowByName(window)->ID;
    const char* last = *(path.end() - 1);
    for (const char* part : path) {
      if (part == last && number) id = ImHashData(&*number, sizeof *number, id);
      id = ImHashStr(part, 0, id);
    }
    const auto all = widgets(window);
    const auto found = all.find(id);
    if (found == all.end()) {
      ADD_FAILURE() << "there is no " << last;
      return {0, 0};
    }
    const ImVec2 a = found->second.front(), b = found->second.back();
    return {(a.x + b.x) / 2, (a.y + b.y) / 2};
  }

  static constexpr float kStep = 5, kAcross = 8;
  ViewerState state_;
};

/// Dear ImGui treats two widgets with one ID as one: the first takes the other's clicks.
TEST_F(Panels, EveryWidgetIsInOnePlace) {
  state_.settings.surfaces.push_back(state_.settings.surfaces[0]);
  state_.settings.planes.push_back({true, {{0, 0, 1}, 10}});
  state_.settings.region_on = true;
  state_.bookmarks->add({"one", camera_, settings_});
  frame();
  const auto all = widgets();
  EXPECT_GT(all.size(), 60u);
  for (const auto& [id, places] : all) {
    float lowest = places[0].y, highest = places[0].y;
    for (const ImVec2& p : places) {
      lowest = std::min(lowest, p.y);
      highest = std::max(highest, p.y);
    }
    // All rows in between belong to it.
    std::map<float, int> rows;
    for (const ImVec2& p : places) ++rows[p.y];
    EXPECT_EQ(rows.size(), static_cast<std::size_t>((highest - lowest) / kStep + 1))
        << "at " << places[0].x << ", " << lowest << " and down to " << highest;
  }
}

TEST_F(Panels, PlanesBookmarksAndSurfacesAreRemovedOneByOne) {
  state_.settings.surfaces.push_back(state_.settings.surfaces[0]);
  state_.settings.planes.push_back({true, {{0, 0, 1}, 10}});
  state_.bookmarks->add({"one", camera_, settings_});
  frame();
  click(place_of({"Clipping and region", "x"}, 0));
  EXPECT_TRUE(state_.settings.planes.empty());
  click(place_of({"Bookmarks", "x"}, 0));
  EXPECT_TRUE(state_.bookmarks->list().empty());
  EXPECT_EQ(state_.settings.surfaces.size(), 2u);
  click(place_of({"Surfaces", "x"}, 0));
  EXPECT_EQ(state_.settings.surfaces.size(), 1u);
}

TEST_F(Panels, SlicesAndCutsHaveTheirOwnBoxes) {
  click(place_of({"Slices", "x", "x"}));
  EXPECT_TRUE(state_.settings.slices[0].shown);
  EXPECT_FALSE(state_.settings.axis_clips[0].on);
  click(place_of({"Clipping and region", "y", "y"}));
  EXPECT_TRUE(state_.settings.axis_clips[1].on);
  EXPECT_FALSE(state_.settings.slices[1].shown);
  click(place_of({"Clipping and region", "Region"}));
  EXPECT_TRUE(state_.settings.region_on);
}

TEST_F(Panels, ATypedIsovalueCountsOnceItIsWhole) {
  ImGuiIO& io = ImGui::GetIO();
  const ImVec2 field = place_of({"Surfaces", "##isovalue"}, 0);
  const auto type = [&](const char* text) {
    test::hold_control(true);
    click(field);  // selects all
    test::hold_control(false);
    for (; *text != 0; ++text) {
      io.AddInputCharacter(static_cast<unsigned>(*text));
      frame();
    }
  };
  const double before = state_.settings.surfaces[0].isovalue;
  type("150.5");
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, before);
  press(ImGuiKey_Enter);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 150.5);
  type("99");
  click({600, 1350});  // beside the panel
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 99);
  type("12");
  press(ImGuiKey_Escape);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 99);
  type("12");
  for (int i = 0; i < 2; ++i) press(ImGuiKey_Backspace);
  type("99");  // the old value
  press(ImGuiKey_Enter);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 99);
  type("nonsense");
  press(ImGuiKey_Enter);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 99);
}

TEST_F(Panels, WhatIsTypedGoesToItsOwnFieldOrNone) {
  state_.settings.surfaces.push_back(state_.settings.surfaces[0]);
  state_.settings.surfaces[0].isovalue = 123.456789123;
  state_.settings.surfaces[1].isovalue = 50;
  frame();
  const ImVec2 first = place_of({"Surfaces", "##isovalue"}, 0),
               second = place_of({"Surfaces", "##isovalue"}, 1), header = place_of({"Surfaces"});
  const auto type = [&](const char* text) {
    for (; *text != 0; ++text) {
      ImGui::GetIO().AddInputCharacter(static_cast<unsigned>(*text));
      frame();
    }
  };
  click(first);
  type("9");
  press(ImGuiKey_Escape);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, 123.456789123) << "not as it is shown";
  click(first);
  type("7");
  ImGui::GetIO().MousePos = header;  // closes the section without another frame of the field
  click(header);
  click(header);
  const double kept = state_.settings.surfaces[0].isovalue;
  click(second);
  click({600, 1350});
  EXPECT_EQ(state_.settings.surfaces[1].isovalue, 50);
  EXPECT_EQ(state_.settings.surfaces[0].isovalue, kept);
  click(second);
  type("*2");
  press(ImGuiKey_Enter);
  EXPECT_EQ(state_.settings.surfaces[1].isovalue, 50) << "no number";
}

TEST_F(Panels, AMessageTakesNobodysFieldAway) {
  click(place_of({"Surfaces", "##isovalue"}, 0));
  ASSERT_TRUE(ImGui::GetIO().WantTextInput);
  state_.show_message("something");
  for (int i = 0; i < 3; ++i) frame();
  EXPECT_TRUE(ImGui::GetIO().WantTextInput);
  press(ImGuiKey_Enter);
  for (int i = 0; i < 3; ++i) frame();
  EXPECT_FALSE(ImGui::GetIO().WantTextInput);
}

TEST_F(Panels, MessagesAreNotBehindThePanel) {
  ImGui::GetIO().DisplaySize = {1000, 800};
  state_.show_message(
      "one two three four five six seven eight nine ten eleven twelve thirteen fourteen");
  frame();
  frame();
  const ImGuiWindow* messages = ImGui::FindWindowByName("Messages");
  const ImGuiWindow* panel = ImGui::FindWindowByName("###panel");
  ASSERT_NE(messages, nullptr);
  EXPECT_GE(messages->Pos.x, panel->Pos.x + panel->Size.x);
  EXPECT_LE(messages->Pos.x + messages->Size.x, 1000);
  EXPECT_GT(messages->FocusOrder, panel->FocusOrder);
}

TEST_F(Panels, ListsOfChannelsAndTimesChooseAnotherVolume) {
  EXPECT_EQ(state_.volumes.axes.size(), 0u);
  const std::size_t widgets_before = widgets().size();
  state_.volumes = {.axes = {{.name = "t", .count = 1'000'000'000, .by_time = true},
                             {.name = "c", .count = 3, .by_channel = true}},
                    .channel_names = {"nuclei", "walls", "a \x01 name"},
                    .selection = {.channel = 0, .time = 4}};
  frame();
  EXPECT_EQ(widgets().size(), widgets_before + 2);
  const auto choose = [&](const char* list, int item) {
    state_.requests = {};
    click(place_of({list}));
    ASSERT_EQ(GImGui->OpenPopupStack.Size, 1);
    const ImGuiWindow* popup = GImGui->OpenPopupStack[0].Window;
    ASSERT_NE(popup, nullptr);
    const float line = ImGui::GetFontSize() + ImGui::GetStyle().ItemSpacing.y;
    click({popup->Pos.x + 30,
           popup->Pos.y + popup->WindowPadding.y + line * (static_cast<float>(item) + 0.4f)});
    EXPECT_EQ(GImGui->OpenPopupStack.Size, 0);
  };
  choose("Channel", 1);
  ASSERT_TRUE(state_.requests.volume);
  EXPECT_EQ(state_.requests.volume->channel, 1);
  EXPECT_EQ(state_.requests.volume->time, 4);
  choose("Channel", 0);
  EXPECT_FALSE(state_.requests.volume) << "it is shown";
  // The list of times starts at the shown one.
  choose("Time", 2);
  ASSERT_TRUE(state_.requests.volume);
  EXPECT_EQ(state_.requests.volume->time, 6);
  EXPECT_EQ(state_.requests.volume->channel, 0);
}

TEST_F(Panels, AConversionCanBeCancelled) {
  const auto file = dir_ / "a_2048x2048x2048_uint8.raw";
  dir_.write("a_2048x2048x2048_uint8.raw", "");
  std::filesystem::resize_file(file, std::uintmax_t{1} << 33);
  state_.import = std::make_unique<ImportJob>(file, OpenOptions{});
  for (int i = 0; i < 3; ++i) frame();
  const ImGuiWindow* popup =
      GImGui->OpenPopupStack.empty() ? nullptr : GImGui->OpenPopupStack[0].Window;
  ASSERT_NE(popup, nullptr);
  click(place_of({"Cancel"}, {}, popup->Name));
  while (!state_.import->state().finished) frame();
  EXPECT_TRUE(state_.import->state().cancelled);
  state_.import.reset();
  frame();
}

TEST_F(Panels, ThePanelKeepsToTheLeftSide) {
  for (const ImVec2 size : {ImVec2(1000, 800), ImVec2(300, 200), ImVec2(1600, 900)}) {
    ImGui::GetIO().DisplaySize = size;
    frame();
    frame();
    const ImGuiWindow* panel = ImGui::FindWindowByName("###panel");
    EXPECT_EQ(panel->Pos.x, 0);
    EXPECT_EQ(panel->Pos.y, 0);
    EXPECT_EQ(panel->Size.y, size.y);
    EXPECT_EQ(state_.panel_width, panel->Size.x);
  }
}

TEST_F(Panels, GrowWithTheFont) {
  const float before = scaled(90);
  const auto width_of = [&](const char* widget) {
    const auto all = widgets();
    ImGuiID id = ImGui::FindWindowByName("###panel")->ID;
    const int first = 0;
    id = ImHashStr("Surfaces", 0, id);
    id = ImHashData(&first, sizeof first, id);
    id = ImHashStr(widget, 0, id);
    const auto& places = all.at(id);
    float lo = places[0].x, hi = lo;
    for (const ImVec2& p : places) {
      lo = std::min(lo, p.x);
      hi = std::max(hi, p.x);
    }
    return hi - lo;
  };
  ImGui::GetIO().DisplaySize = {1400, 2800};
  const float one = width_of("##isovalue");
  test::scale_font(2);
  frame();
  EXPECT_EQ(scaled(90), 2 * before);
  ImGui::SetWindowSize("###panel", {scaled(kPanelWidth), 2700});
  frame();
  EXPECT_NEAR(width_of("##isovalue"), 2 * one, 2 * kAcross);
}

TEST_F(Panels, MessagesGoAwayUnlessSomebodyReadsThem) {
  state_.message_time = std::chrono::milliseconds(50);
  state_.show_message("something");
  frame();
  frame();
  state_.drop_old_messages();
  EXPECT_EQ(state_.messages.size(), 1u);
  const ImGuiWindow* window = ImGui::FindWindowByName("Messages");
  point(window->Pos.x + 20, window->Pos.y + window->Size.y - 10);
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  frame();
  state_.drop_old_messages();
  EXPECT_EQ(state_.messages.size(), 1u) << "the pointer is on it";
  point(5, 5);
  std::this_thread::sleep_for(std::chrono::milliseconds(60));
  frame();
  state_.drop_old_messages();
  EXPECT_TRUE(state_.messages.empty());
}

TEST_F(Panels, HelpShowsKeysAndCloses) {
  EXPECT_EQ(ImGui::FindWindowByName("Keys and mouse"), nullptr);
  click(place_of({"Help (F1)"}));
  EXPECT_TRUE(state_.help);
  frame();
  const ImGuiWindow* help = ImGui::FindWindowByName("Keys and mouse");
  ASSERT_NE(help, nullptr);
  EXPECT_TRUE(help->Active);
  EXPECT_GT(help->Size.y, 20 * ImGui::GetFontSize());
  state_.help = false;
  frame();
  frame();
  EXPECT_FALSE(help->Active);
}

TEST_F(Panels, TheStatusNamesBricks) {
  EXPECT_EQ(state_.scene_renderer->scene().stream().missing_bricks(), 0u) << "all are there";
  // One thread, and a cut of many bricks.
  open(SynthKind::gyroid, {200, 200, 200}, {.threads = 1});
  const SceneStream& stream = scene_renderer_->scene().stream();
  const auto all = static_cast<std::uint64_t>(7 * 7 * 7);
  scene_renderer_->scene().update({settings_.surfaces[0].isovalue},
                                  view_of(camera_, kWidth, kHeight, settings_.pixel_error), {});
  const std::uint64_t most = stream.missing_bricks();
  EXPECT_GT(most, all / 4);
  EXPECT_LE(most, 2 * all) << "each counts once";
  do {
    scene_renderer_->draw(camera_, kWidth, kHeight, settings_);
  } while (!scene_renderer_->state().complete);
  EXPECT_EQ(stream.missing_bricks(), 0u);
}

}  // namespace
}  // namespace isobrick
