# ruff: noqa: E501  headers stand as they are written
"""Weather as other programs write it: a row a source, each two hours of one afternoon in the source's own form."""

import pytest

from warp_torchrl.system.provenance import gathered
from warp_torchrl.world.weather.table import read_weather

# Most sources write the same air, 5 and 10 m/s from 270 and 300 degrees, 30 and 31 C, 25 and 20 per cent, 0 and 2.54 mm
SPEED, BEARING, TEMPERATURE, HUMIDITY, RAIN = [5.0, 10.0], [270.0, 300.0], [30.0, 31.0], [25.0, 20.0], [0.0, 2.54]
MPH, KT = 0.44704, 0.514444

FORMATS = {
    "Open-Meteo": """
latitude,longitude,elevation,utc_offset_seconds,timezone,timezone_abbreviation
52.52,13.419998,38.0,7200,Europe/Berlin,GMT+2

time,temperature_2m (°C),relative_humidity_2m (%),precipitation (mm),rain (mm),wind_speed_10m (km/h),wind_speed_100m (km/h),wind_direction_10m (°),wind_gusts_10m (km/h)
2024-07-01T12:00,30.0,25,0.00,0.00,18.0,40.1,270,61.2
2024-07-01T13:00,31.0,20,2.54,1.00,36.0,44.0,300,70.2
""",
    "Open-Meteo, m/s and seconds since 1970": """
latitude,longitude,elevation,utc_offset_seconds,timezone,timezone_abbreviation
52.52,13.419998,38.0,0,GMT,GMT

time,temperature_2m (°F),relative_humidity_2m (%),precipitation (inch),windspeed_10m (m/s),winddirection_10m (°)
1719835200,86.0,25,0.00,5.0,270
1719838800,87.8,20,0.10,10.0,300
""",
    "Environment Canada": """
"Longitude (x)","Latitude (y)","Station Name","Climate ID","Date/Time (LST)","Year","Month","Day","Time (LST)","Flag","Temp (°C)","Temp Flag","Dew Point Temp (°C)","Dew Point Temp Flag","Rel Hum (%)","Rel Hum Flag","Precip. Amount (mm)","Precip. Amount Flag","Wind Dir (10s deg)","Wind Dir Flag","Wind Spd (km/h)","Wind Spd Flag","Visibility (km)"
"-114.0","51.1","CALGARY","3031094","2024-07-01 12:00","2024","07","01","12:00","","30.0","","8.0","","25","","0.0","","27","","18","","24.1"
"-114.0","51.1","CALGARY","3031094","2024-07-01 13:00","2024","07","01","13:00","","31.0","","7.0","","20","","2.54","","30","","36","","24.1"
""",
    "Synoptic": """
# STATION: BNDC1
# STATION NAME: BEN LOMOND
# LATITUDE: 37.130940
# LONGITUDE: -122.172610
# ELEVATION [ft]: 2598
# STATE: CA
Station_ID,Date_Time,air_temp_set_1,relative_humidity_set_1,wind_speed_set_1,wind_direction_set_1,wind_gust_set_1,precip_accum_one_hour_set_1,wind_cardinal_direction_set_1d
,,Celsius,%,m/s,Degrees,m/s,Millimeters,code
BNDC1,2024-07-01T12:00:00-0700,30.0,25.0,5.0,270.0,9.1,0.0,W
BNDC1,2024-07-01T13:00:00-0700,31.0,20.0,10.0,300.0,14.0,2.54,WNW
""",
    "MesoWest in English units": f"""
# STATION: BNDC1
Station_ID,Date_Time,air_temp_set_1,relative_humidity_set_1,wind_speed_set_1,wind_direction_set_1,precip_accum_one_hour_set_1
,,Fahrenheit,%,Miles/hour,Degrees,Inches
BNDC1,07/01/2024 23:50 UTC,86.0,25.0,{5 / MPH},270.0,0.0
BNDC1,07/02/2024 00:50 UTC,87.8,20.0,{10 / MPH},300.0,0.1
""",
    "Meteostat": """
date,hour,temp,dwpt,rhum,prcp,snow,wdir,wspd,wpgt,pres,tsun,coco
2024-07-01,12,30.0,8.0,25,0.0,,270,18.0,30.0,1012.0,60,1
2024-07-01,13,31.0,7.0,20,2.54,,300,36.0,50.0,1011.0,60,1
""",
    "FEMS (FW21)": f"""
StationId,DateTime,Temperature(F),RelativeHumidity(%),Precipitation(in),WindSpeed(mph),WindAzimuth(degrees),GustSpeed(mph),GustAzimuth(degrees),SnowFlag,SolarRadiation(W/m2),Tflag
53005,2024-07-01T12:00:00-06:00,86,25,0.00,{5 / MPH},270,20,270,0,800,0
53005,2024-07-01T13:00:00-06:00,87.8,20,0.10,{10 / MPH},300,30,300,0,800,0
""",
    "FARSITE, metric": """
RAWS_ELEVATION: 1280
RAWS_UNITS: Metric
RAWS: 2

Year  Mth  Day   Time    Temp     RH    HrlyPcp   WindSpd  WindDir CloudCov
2024   7    1    1200     30      25      0.00       18      270      10
2024   7    1    1300     31      20      2.54       36      300      10
""",
    "Burn-P3+": """
Season,Temperature,RelativeHumidity,WindSpeed,WindDirection,Precipitation,FineFuelMoistureCode,DuffMoistureCode,DroughtCode,InitialSpreadIndex,BuildupIndex,FireWeatherIndex
Summer,30,25,18,270,0,92,60,400,9.1,86.6,27.1
Summer,31,20,36,300,2.54,92,60,400,9.1,86.6,27.1
""",
    "Prometheus": """
HOURLY,HOUR,TEMP,RH,WD,WS,PRECIP,FFMC,DMC,DC
01/07/2024,23,30.0,25,270,18,0.00,92,60,400
02/07/2024,0,31.0,20,300,36,2.54,92,60,400
""",
    "SpotWX": """
HOURLY,HOUR,TEMP,RH,WD,WS,PRECIP
2024-07-01, 23, 30.0, 25, 270, 18, 0.00
2024-07-02, 00, 31.0, 20, 300, 36, 2.54
""",
    "cffdrs": """
id,lat,long,yr,mon,day,hr,temp,rh,ws,wd,prec,ffmc,dmc,dc
1,45.98,-77.3,2024,7,1,12,30,25,18,270,0,92,60,400
1,45.98,-77.3,2024,7,1,13,31,20,36,300,2.54,92,60,400
""",
    "Cell2Fire": """
Scenario,datetime,APCP,TMP,RH,WS,WD,FFMC,DMC,DC,ISI,BUI,FWI
JCB,01-07-2024 23:00,0,30,25,18,270,92,60,400,9.1,86.6,27.1
JCB,02-07-2024 0:00,2.54,31,20,36,300,92,60,400,9.1,86.6,27.1
""",
    "ERA5 of the Climate Data Store": """
valid_time,u10,v10,d2m,t2m,sp,tp,latitude,longitude
2024-07-01 12:00:00,5.0,0.0,280.9,303.15,101000.0,0.0,43.25,-2.0
2024-07-01 13:00:00,8.660254,-5.0,278.5,304.15,101000.0,0.00254,43.25,-2.0
""",
    "NASA POWER": """
-BEGIN HEADER-
NASA/POWER Source Native Resolution Hourly Data
WS10M       MERRA-2 Wind Speed at 10 Meters (m/s)
-END HEADER-
YEAR,MO,DY,HR,T2M,RH2M,PRECTOTCORR,WS10M,WD10M
2024,7,1,12,30.0,25.0,0.0,5.0,270.0
2024,7,1,13,31.0,20.0,2.54,10.0,300.0
""",
    "Iowa Environmental Mesonet": f"""
#DEBUG: Format Typ    -> comma
station,valid,tmpf,dwpf,relh,drct,sknt,p01i,gust
APA,2024-07-01 12:00,86.0,45.0,25.0,270.0,{5 / KT},0.0,M
APA,2024-07-01 13:00,87.8,44.0,20.0,300.0,{10 / KT},0.1,M
""",
    "NOAA Local Climatological Data": f"""
"STATION","DATE","REPORT_TYPE","HourlyDewPointTemperature","HourlyDryBulbTemperature","HourlyPrecipitation","HourlyRelativeHumidity","HourlyWindDirection","HourlyWindGustSpeed","HourlyWindSpeed"
"72466093067","2024-07-01T12:00:00","FM-15","45","86","T","25","270","","{5 / MPH}"
"72466093067","2024-07-01T13:00:00","FM-15","44","87.8","0.10","20","300","30","{10 / MPH}"
""",
    "AEMET, from its page": """
Estación: Madrid Retiro
Actualizado: 01/07/2024 14:00
"Fecha y hora oficial";"Temperatura (ºC)";"Velocidad del viento (km/h)";"Dirección del viento";"Racha (km/h)";"Precipitación (mm)";"Presión (hPa)";"Humedad (%)"
"01/07/2024 14:00";"32,0";"0";"Calma";"50";"0,0";"940,1";"20"
"01/07/2024 13:00";"31,0";"36";"Noroeste";"50";"2,54";"940,1";"20"
"01/07/2024 12:00";"30,0";"18";"Oeste";"30";"0,0";"940,5";"25"
""",
    "AEMET OpenData": """
idema,fint,prec,vv,dv,vmax,ta,hr
3195,2024-07-01T12:00:00+0000,0.0,5.0,270.0,9.0,30.0,25.0
3195,2024-07-01T13:00:00+0000,2.54,10.0,300.0,15.0,31.0,20.0
""",
    "INMET": """
REGIAO:;CO
ESTACAO:;BRASILIA
LATITUDE:;-15,78944444
DATA (YYYY-MM-DD);HORA (UTC);PRECIPITAÇÃO TOTAL, HORÁRIO (mm);PRESSAO ATMOSFERICA AO NIVEL DA ESTACAO, HORARIA (mB);TEMPERATURA DO AR - BULBO SECO, HORARIA (°C);TEMPERATURA DO PONTO DE ORVALHO (°C);UMIDADE RELATIVA DO AR, HORARIA (%);VENTO, DIREÇÃO HORARIA (gr) (° (gr));VENTO, RAJADA MAXIMA (m/s);VENTO, VELOCIDADE HORARIA (m/s);
2024/07/01;1200 UTC;0;888,9;30;8,1;25;270;9,1;5;
2024/07/01;1300 UTC;2,54;888,1;31;7,1;20;300;14,2;10;
""",
    "IPMA, as portals have it": """
Data;Hora;Temperatura do ar (°C);Humidade relativa (%);Intensidade do vento (km/h);Direção do vento (graus);Precipitação (mm)
01-07-2024;12:00;30,0;25;18,0;270;0,0
01-07-2024;13:00;31,0;20;36,0;300;2,54
""",
    "Bureau of Meteorology (.axf)": """
[header]
name[80],"Brisbane"
[data]
sort_order,wmo,name[80],history_product[80],local_date_time[80],local_date_time_full[80],lat,lon,air_temp,dewpt,rain_trace[80],rel_hum,wind_dir[80],wind_spd_kmh,wind_spd_kt
0,94576,"Brisbane","IDQ60901","01/2:00pm","20240701140000",-27.5,153.0,32.0,9.0,"0.0",20,"CALM",0,0
1,94576,"Brisbane","IDQ60901","01/1:00pm","20240701130000",-27.5,153.0,31.0,9.0,"0.0",20,"NW",36,19
2,94576,"Brisbane","IDQ60901","01/12:00pm","20240701120000",-27.5,153.0,30.0,9.0,"0.0",25,"W",18,10
[$]
""",
    "Bureau of Meteorology, hourly": """
Station Number,Year Month Day Hour Minutes in YYYY,MM,DD,HH24,MI format in Local time,Precipitation since 9am local time in mm,Precipitation in last 60 minutes in mm,Air Temperature in degrees C,Relative humidity in percentage %,Wind speed in km/h,Wind direction in degrees true
40913,2024,07,01,12,00,3.0,0.0,30.0,25,18.0,270
40913,2024,07,01,13,00,3.0,2.5,31.0,20,36.0,300
""",
    "Météo-France": """
NUM_POSTE;NOM_USUEL;LAT;LON;ALTI;AAAAMMJJHH;RR1;QRR1;FF;QFF;DD;QDD;T;QT;U;QU
13054001;MARIGNANE;43.43;5.21;9;2024070112;0.0;1;5.0;1;270;1;30.0;1;25;1
13054001;MARIGNANE;43.43;5.21;9;2024070113;2.54;1;10.0;1;300;1;31.0;1;20;1
""",
    "Campbell Scientific (TOA5)": """
"TOA5","CR1000","CR1000","1234","CR1000.Std.32","CPU:met.CR1","5678","Hourly"
"TIMESTAMP","RECORD","AirTC_Avg","RH","WS_ms_Avg","WindDir","Rain_mm_Tot"
"TS","RN","Deg C","%","meters/second","Deg","mm"
"","","Avg","Smp","Avg","Smp","Tot"
"2024-07-01 12:00:00",1,30,25,5,270,0
"2024-07-01 13:00:00",2,31,20,10,300,2.54
""",
    "HOBOware": """
"Plot Title: ridge"
"#","Date Time, GMT-07:00","Temp, °C (LGR S/N: 1, SEN S/N: 2)","RH, % (LGR S/N: 1)","Wind Speed, m/s (LGR S/N: 1)","Wind Direction, ø (LGR S/N: 1)","Rain, mm (LGR S/N: 1)"
1,07/01/24 12:00:00 PM,30.0,25.0,5.0,270,0
2,07/01/24 01:00:00 PM,31.0,20.0,10.0,300,2.54
""",
    "Davis WeatherLink": f"""
"Date & Time","Temp - °F","Hum - %","Avg Wind Speed - mph","Prevailing Wind Direction","Rain - in"
"7/1/24 12:00 PM",86.0,25,{5 / MPH},W,0.00
"7/1/24 1:00 PM",87.8,20,{10 / MPH},WNW,0.10
""",
}
# What differs from the air above
KNOWN = {
    "Bureau of Meteorology (.axf)": {"wind_bearing": [270, 315, 0], "rain": None, "wind_speed": [5, 10, 0]},
    "Bureau of Meteorology, hourly": {"rain": [0, 2.5]},
    "AEMET, from its page": {"wind_bearing": [270, 315, 0], "wind_speed": [5, 10, 0], "rain": [0, 2.54, 0]},
    "NOAA Local Climatological Data": {"rain": [0, 2.54]},
    "Davis WeatherLink": {"wind_bearing": [270, 292.5]},
    "ERA5 of the Climate Data Store": {"humidity": [24.86, 19.88]},
}
IN_FEET = {"MesoWest in English units", "FEMS (FW21)", "Davis WeatherLink"}


@pytest.fixture
def read(tmp_path):
    def read(text, name="weather.csv", encoding="utf-8", **options):
        (tmp_path / name).write_bytes(text.strip("\n").encode(encoding))
        with gathered() as files:
            weather = read_weather(tmp_path / name, **options)
        return weather, files[0]

    return read


@pytest.mark.parametrize("source", FORMATS)
def test_the_air_of_an_afternoon_is_the_same_in_every_form(read, source):
    weather, files = read(FORMATS[source])
    known = KNOWN.get(source, {})
    rows = len(known.get("wind_speed", SPEED))
    assert weather.hours.tolist() == list(range(rows))
    told = {
        "wind_speed": SPEED,
        "wind_bearing": BEARING,
        "temperature": [30, 31, 32][:rows],
        "humidity": [25, 20, 20][:rows],
        "rain": RAIN,
    }
    for name, values in (told | known).items():
        found = getattr(weather, name)
        if values is None:
            assert found is None, name
        else:
            assert found.tolist() == pytest.approx(values, abs=0.06), name
    assert weather.wind_height == ("20ft" if source in IN_FEET else "10m")
    assert files.key == "weather" and any("wind_speed" in unit or "wind_u" in unit for unit in files.read.values())


def test_of_several_tables_in_a_file_the_longest_of_weather_is_read(read):
    weather, files = read("""
latitude,longitude,elevation,utc_offset_seconds,timezone,timezone_abbreviation
41.0,2.0,NaN,3600,GMT,GMT

current_weather_time,temperature (°C),windspeed (km/h),winddirection (°),weathercode (wmo code),is_day
2024-07-01T16:00,23.0,12.0,90,5,1

time,temperature_2m (°C),windspeed_10m (km/h),winddirection_10m (°)
2024-07-01T12:00,30.0,18.0,270
2024-07-01T13:00,31.0,36.0,300

time,temperature_2m_max (°C),wind_speed_10m_max (km/h)
2024-07-01,31,40
""")
    assert weather.wind_speed.tolist() == SPEED and weather.temperature.tolist() == [30, 31]
    assert files.left == ("4 lines above the header", "a second table of 1 rows")
    two = "WS,WD\n18,270\n36,300\n"
    weather, files = read(f"{two}{two}windspeed (mph),wd\n1,2\n")  # one header twice, and then another
    assert weather.wind_speed.tolist() == SPEED * 2 and files.left == ("a second table of 1 rows",)
