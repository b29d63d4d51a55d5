"""Events in the order in which they happened."""

from server_gui.core.follow.news import News, NewsKind


def test_what_is_known_late_stands_where_it_happened() -> None:
    news = News()
    for text, ago_s in (("first", 20.0), ("third", 0.0), ("second", 10.0), ("oldest", 99.0), ("newest", 0.0)):
        news.add(NewsKind.PARAMETER, "exo-01", text, ago_s=ago_s)
    assert [item.text for item in news.items] == ["newest", "third", "second", "first", "oldest"]
    assert [item.utc_s for item in news.items] == sorted((item.utc_s for item in news.items), reverse=True)
